#include "heft/exchange/load_formats.hpp"

#include <algorithm>
#include <array>
#include <numbers>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "angles.hpp"
#include "heft/host/error.hpp"
#include "load.hpp"
#include "principal_axes.hpp"
#include "xml_text.hpp"

namespace heft::exchange {
namespace {

using Eigen::Vector3d;

constexpr double kMillimetres = 1e3, kCentimetres = 1e2;
constexpr double kDegrees = 180.0 / std::numbers::pi;
/// One kgf·cm·s² [kg·m²].
constexpr double kKgfCmS2 = 0.0980665;

std::string list(const std::vector<double>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number(value));
  return fmt::format("{}", fmt::join(texts, ", "));
}
std::string list(const Vector3d& v) { return list(std::vector<double>{v[0], v[1], v[2]}); }
/// All nine, column by column, as Franka's interface has matrices; a tensor of inertia is the same by rows.
std::string nine(const Eigen::Matrix3d& m) { return list(std::vector<double>(m.data(), m.data() + 9)); }

/// set_target_payload(m, cog, inertia, transition_time): cog from the flange; inertia about the centre of gravity, axes
/// of the flange, Ixx Iyy Izz Ixy Ixz Iyz.
std::string ur_script(const Load& load, const LoadOptions& options) {
  const Eigen::Matrix3d& i = load.inertia;
  return fmt::format("set_target_payload({}, [{}], [{}], {})\n", number(load.mass), list(load.com),
                     list(std::vector<double>{i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)}),
                     number(options.transition_time));
}

/// ur_msgs/srv/SetPayload: a geometry_msgs/Inertia, whose order differs from that of URScript.
std::string ur_ros2(const Load& load, const LoadOptions& options) {
  const Eigen::Matrix3d& i = load.inertia;
  return fmt::format(
      "payload:\n"
      "  m: {}\n"
      "  com: {{x: {}, y: {}, z: {}}}\n"
      "  ixx: {}\n  ixy: {}\n  ixz: {}\n  iyy: {}\n  iyz: {}\n  izz: {}\n"
      "transition_time: {}\n",
      number(load.mass), number(load.com[0]), number(load.com[1]), number(load.com[2]), number(i(0, 0)),
      number(i(0, 1)), number(i(0, 2)), number(i(1, 1)), number(i(1, 2)), number(i(2, 2)),
      number(options.transition_time));
}

std::string franka(const Load& load, const LoadOptions&) {
  return fmt::format("robot.setLoad({}, {{{{{}}}}}, {{{{{}}}}});\n", number(load.mass), list(load.com),
                     nine(load.inertia));
}

std::string franka_desk(const Load& load, const LoadOptions&) {
  return fmt::format(
      "{{\n  \"mass\": {},\n  \"centerOfMass\": [{}],\n"
      "  \"transformation\": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],\n  \"inertia\": [{}]\n}}\n",
      number(load.mass), list(load.com), nine(load.inertia));
}

/// LOAD_DATA: mm and degrees; A, B, C turn about z, y', x'' to the principal axes; J about the centre of mass.
std::string kuka(const Load& load, const LoadOptions&) {
  const PrincipalAxes axes = principal_axes(load.inertia);
  const Vector3d cm = kMillimetres * load.com, turn = kDegrees * roll_pitch_yaw(axes.rotation);
  return fmt::format("LOAD_DATA[1]={{M {},CM {{X {},Y {},Z {},A {},B {},C {}}},J {{X {},Y {},Z {}}}}}\n",
                     number(load.mass), number(cm[0]), number(cm[1]), number(cm[2]), number(turn[2]),
                     number(turn[1]), number(turn[0]), number(axes.moments[0]), number(axes.moments[1]),
                     number(axes.moments[2]));
}

/// loaddata: mm; aom turns from the tool frame to the principal axes; ix, iy, iz about the centre of gravity.
std::string abb(const Load& load, const LoadOptions&) {
  const PrincipalAxes axes = principal_axes(load.inertia);
  const Eigen::Quaterniond aom(axes.rotation);
  return fmt::format("PERS loaddata heft_load := [{}, [{}], [{}], {}];\n", number(load.mass),
                     list(kMillimetres * load.com),
                     list(std::vector<double>{aom.w(), aom.x(), aom.y(), aom.z()}), list(axes.moments));
}

/// A payload schedule: moments about axes through the centre of mass that are parallel to those of the flange. It has no
/// products of inertia.
std::string fanuc(const Load& load, const LoadOptions&) {
  const Vector3d cm = kCentimetres * load.com;
  const Vector3d moments = load.inertia.diagonal() / kKgfCmS2;
  std::string text = fmt::format(
      "PAYLOAD [kg] : {}\n"
      "PAYLOAD CENTER X [cm] : {}\nPAYLOAD CENTER Y [cm] : {}\nPAYLOAD CENTER Z [cm] : {}\n"
      "PAYLOAD INERTIA X [kgfcms^2] : {}\nPAYLOAD INERTIA Y [kgfcms^2] : {}\nPAYLOAD INERTIA Z [kgfcms^2] : {}\n",
      number(load.mass), number(cm[0]), number(cm[1]), number(cm[2]), number(moments[0]), number(moments[1]),
      number(moments[2]));
  Eigen::Matrix3d products = load.inertia;
  products.diagonal().setZero();
  const double most = load.inertia.diagonal().cwiseAbs().maxCoeff();
  if (products.cwiseAbs().maxCoeff() > 1e-3 * most) {
    text += fmt::format(
        "! without the products of inertia, up to {:.2g} kg·m² ({:.0f} % of the largest moment): the schedule has none\n",
        products.cwiseAbs().maxCoeff(), 100.0 * products.cwiseAbs().maxCoeff() / most);
  }
  return text;
}

std::string urdf(const Load& load, const LoadOptions& options) {
  const Eigen::Matrix3d& i = load.inertia;
  XmlText xml;
  xml.open("link", {{"name", "payload"}});
  xml.open("inertial");
  xml.element("origin", {{"xyz", numbers(load.com)}, {"rpy", "0 0 0"}});
  xml.element("mass", {{"value", number(load.mass)}});
  xml.element("inertia", {{"ixx", number(i(0, 0))},
                          {"ixy", number(i(0, 1))},
                          {"ixz", number(i(0, 2))},
                          {"iyy", number(i(1, 1))},
                          {"iyz", number(i(1, 2))},
                          {"izz", number(i(2, 2))}});
  xml.close("inertial");
  xml.close("link");
  xml.open("joint", {{"name", "payload_mount"}, {"type", "fixed"}});
  xml.element("parent", {{"link", options.link}});
  xml.element("child", {{"link", "payload"}});
  xml.element("origin", {{"xyz", "0 0 0"}, {"rpy", "0 0 0"}});
  xml.close("joint");
  return xml.text();
}

/// xx, yy, zz, xy, xz, yz.
std::string six(const Eigen::Matrix3d& i) {
  Eigen::Matrix<double, 6, 1> entries;
  entries << i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2);
  return numbers(entries);
}

std::string mjcf(const Load& load, const LoadOptions& options) {
  const Eigen::Matrix3d& i = load.inertia;
  XmlText xml;
  xml.comment(fmt::format("inside the body \"{}\"", options.link));
  xml.open("body", {{"name", "payload"}});
  xml.element("inertial",
              {{"pos", numbers(load.com)},
               {"mass", number(load.mass)},
               {load.inertia.isZero() ? "diaginertia" : "fullinertia",
                load.inertia.isZero() ? "0 0 0" : six(i)}});  // its compiler takes no full tensor of zeros
  xml.close("body");
  return xml.text();
}

struct LoadWriter {
  LoadFormat format;
  std::string (*write)(const Load&, const LoadOptions&);
};

constexpr std::array<LoadWriter, 9> kLoadWriters{{
    {{"ur-script", "URScript set_target_payload (PolyScope 5.10 and later)",
      "from the tool flange, in its axes"},
     ur_script},
    {{"ur-ros2", "ROS 2 ur_msgs/srv/SetPayload", "from the tool flange, in its axes"}, ur_ros2},
    {{"franka", "libfranka setLoad",
      "from the flange, in its axes; an end effector set in Desk counts in addition"},
     franka},
    {{"franka-desk", "Franka Desk, end effector as JSON", "from the flange, in its axes"}, franka_desk},
    {{"kuka", "KUKA KRC LOAD_DATA in $config.dat", "from the flange, in its axes"}, kuka},
    {{"abb", "ABB RAPID loaddata", "from tool0, that is the flange; another tool frame needs a shift"}, abb},
    {{"fanuc", "FANUC payload schedule, to be entered on the screen", "from the flange, in its axes"}, fanuc},
    {{"urdf", "URDF link, fixed to the flange's link", "from that link, in its axes"}, urdf},
    {{"mjcf", "MuJoCo body", "from the flange's body, in its axes"}, mjcf},
}};

constexpr auto kLoadFormats = [] {
  std::array<LoadFormat, kLoadWriters.size()> formats;
  for (std::size_t k = 0; k < formats.size(); ++k) formats[k] = kLoadWriters[k].format;
  return formats;
}();

}  // namespace

std::span<const LoadFormat> load_formats() { return kLoadFormats; }

std::string to_text(const Load& load, std::string_view format, const LoadOptions& options) {
  const auto found = std::find_if(kLoadWriters.begin(), kLoadWriters.end(),
                                  [&](const LoadWriter& writer) { return writer.format.id == format; });
  if (found == kLoadWriters.end()) {
    std::vector<std::string_view> ids;
    for (const LoadFormat& known : kLoadFormats) ids.push_back(known.id);
    throw InputError(
        fmt::format("no load can be written as '{}'; expected one of {}", format, fmt::join(ids, ", ")));
  }
  refuse_impossible(load, "the load");
  if (!(options.transition_time >= 0.0) || !(options.transition_time < 1e3)) {
    throw InputError(fmt::format("transition time of {} s; expected 0 to 1000 s", options.transition_time));
  }
  return found->write(load, options);
}

}  // namespace heft::exchange
