#include "heft/exchange/robot_formats.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "angles.hpp"
#include "heft/host/error.hpp"
#include "left_out.hpp"
#include "load.hpp"
#include "xml_text.hpp"

namespace heft::exchange {
namespace {

using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using model::Robot;
using model::RobotJoint;

Eigen::Matrix3d rotation_of(const std::array<double, 9>& rotation) {
  return Eigen::Map<const Matrix3>(rotation.data());
}
Eigen::Vector3d vector_of(const std::array<double, 3>& v) {
  return Eigen::Map<const Eigen::Vector3d>(v.data());
}
std::string rpy(const std::array<double, 9>& rotation) {
  return numbers(roll_pitch_yaw(rotation_of(rotation)));
}
std::string quaternion(const std::array<double, 9>& rotation) {
  const Eigen::Quaterniond q(rotation_of(rotation));
  return numbers(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
}
bool turns(const RobotJoint& joint) { return joint.joint.type == JointType::kRevolute; }
bool is_limited(const RobotJoint& joint) { return std::isfinite(joint.lower) && std::isfinite(joint.upper); }

/// A link's body; absent: it has neither mass nor inertia.
std::optional<Load> body_of(const RobotJoint& joint) {
  if (std::all_of(joint.link.begin(), joint.link.end(), [](double value) { return value == 0.0; }))
    return std::nullopt;
  return load_of(joint.link, fmt::format("link \"{}\"", joint.link_name));
}

/// What every form checks before a word is written.
void refuse_unfit(const Robot& robot) {
  if (robot.joints.empty()) throw ModelError("found a robot without joints; expected one at least");
  for (int j = 0; j < robot.num_joints(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    body_of(joint);
    refuse_negative(joint.name, "Coulomb friction", joint.actuation.coulomb_friction);
    refuse_negative(joint.name, "viscous friction", joint.actuation.viscous_friction);
    refuse_negative(joint.name, "rotor inertia", rotor_inertia_of(robot, j));
  }
}

void urdf_inertial(XmlText& xml, const Load& body) {
  const Eigen::Matrix3d& i = body.inertia;
  xml.open("inertial");
  xml.element("origin", {{"xyz", numbers(body.com)}, {"rpy", "0 0 0"}});
  xml.element("mass", {{"value", number(body.mass)}});
  xml.element("inertia", {{"ixx", number(i(0, 0))},
                          {"ixy", number(i(0, 1))},
                          {"ixz", number(i(0, 2))},
                          {"iyy", number(i(1, 1))},
                          {"iyz", number(i(1, 2))},
                          {"izz", number(i(2, 2))}});
  xml.close("inertial");
}

std::string urdf(const Robot& robot) {
  XmlText xml;
  xml.open("robot", {{"name", robot.name}});
  xml.open("link", {{"name", robot.base_link}});
  xml.close("link");
  std::string parent = robot.base_link;
  for (const RobotJoint& joint : robot.joints) {
    xml.open("link", {{"name", joint.link_name}});
    if (const auto body = body_of(joint)) urdf_inertial(xml, *body);
    xml.close("link");
    const char* const type = !turns(joint) ? "prismatic" : is_limited(joint) ? "revolute" : "continuous";
    xml.open("joint", {{"name", joint.name}, {"type", type}});
    xml.element("parent", {{"link", parent}});
    xml.element("child", {{"link", joint.link_name}});
    xml.element("origin",
                {{"xyz", numbers(vector_of(joint.joint.position))}, {"rpy", rpy(joint.joint.rotation)}});
    xml.element("axis", {{"xyz", numbers(vector_of(joint.joint.axis))}});
    // URDF wants effort and velocity wherever there is a limit; none is a number that no arm reaches.
    constexpr double kNone = 1e9;
    const auto or_none = [](double value) { return number(std::isfinite(value) ? value : kNone); };
    if (is_limited(joint)) {
      xml.element("limit", {{"lower", number(joint.lower)},
                            {"upper", number(joint.upper)},
                            {"effort", or_none(joint.effort_limit)},
                            {"velocity", or_none(joint.velocity_limit)}});
    } else if (!turns(joint)) {
      xml.element("limit", {{"lower", number(-kNone)},
                            {"upper", number(kNone)},
                            {"effort", or_none(joint.effort_limit)},
                            {"velocity", or_none(joint.velocity_limit)}});
    }
    xml.element("dynamics", {{"damping", number(joint.actuation.viscous_friction)},
                             {"friction", number(joint.actuation.coulomb_friction)}});
    xml.close("joint");
    parent = joint.link_name;
  }
  if (robot.tip_link != parent) {
    xml.open("link", {{"name", robot.tip_link}});
    xml.close("link");
    xml.open("joint", {{"name", robot.tip_link + "_mount"}, {"type", "fixed"}});
    xml.element("parent", {{"link", parent}});
    xml.element("child", {{"link", robot.tip_link}});
    xml.element("origin",
                {{"xyz", numbers(vector_of(robot.tip_position))}, {"rpy", rpy(robot.tip_rotation)}});
    xml.close("joint");
  }
  xml.close("robot");
  return "<?xml version=\"1.0\"?>\n" + xml.text();
}

std::string mjcf(const Robot& robot) {
  XmlText xml;
  xml.open("mujoco", {{"model", robot.name}});
  xml.element("compiler", {{"angle", "radian"}, {"autolimits", "true"}});
  xml.element("option", {{"gravity", numbers(vector_of(robot.gravity))}});
  xml.open("worldbody");
  xml.open("body", {{"name", robot.base_link}});
  for (int j = 0; j < robot.num_joints(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    xml.open("body", {{"name", joint.link_name},
                      {"pos", numbers(vector_of(joint.joint.position))},
                      {"quat", quaternion(joint.joint.rotation)}});
    if (const auto body = body_of(joint)) {
      const Eigen::Matrix3d& i = body->inertia;
      Eigen::Matrix<double, 6, 1> six;
      six << i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2);
      xml.element("inertial",
                  {{"pos", numbers(body->com)}, {"mass", number(body->mass)}, {"fullinertia", numbers(six)}});
    }
    const JointSpring spring = spring_of(robot, j);
    const bool has_spring = spring.stiffness != 0.0;
    xml.element("joint",
                {{"name", joint.name},
                 {"type", turns(joint) ? "hinge" : "slide"},
                 {"axis", numbers(vector_of(joint.joint.axis))},
                 {"range", is_limited(joint) ? numbers(Eigen::Vector2d(joint.lower, joint.upper)) : ""},
                 {"damping", number(joint.actuation.viscous_friction)},
                 {"frictionloss", number(joint.actuation.coulomb_friction)},
                 {"armature", number(rotor_inertia_of(robot, j))},
                 {"stiffness", has_spring ? number(spring.stiffness) : ""},
                 {"springref", has_spring ? number(spring.rest) : ""}});
  }
  xml.element("site", {{"name", robot.tip_link},
                       {"pos", numbers(vector_of(robot.tip_position))},
                       {"quat", quaternion(robot.tip_rotation)}});
  for (int j = 0; j < robot.num_joints() + 1; ++j) xml.close("body");
  xml.close("worldbody");
  xml.open("actuator");
  for (const RobotJoint& joint : robot.joints) {
    const bool limited = std::isfinite(joint.effort_limit);
    xml.element(
        "motor",
        {{"name", joint.name},
         {"joint", joint.name},
         {"ctrlrange", limited ? numbers(Eigen::Vector2d(-joint.effort_limit, joint.effort_limit)) : ""}});
  }
  xml.close("actuator");
  xml.close("mujoco");
  return xml.text();
}

/// Position and roll, pitch, yaw in one text.
std::string pose(const std::array<double, 3>& position, const std::array<double, 9>& rotation) {
  return numbers(vector_of(position)) + " " + rpy(rotation);
}

void sdf_link(XmlText& xml, const RobotJoint& joint, const std::string& parent) {
  xml.open("link", {{"name", joint.link_name}});
  xml.element("pose", {{"relative_to", parent}}, pose(joint.joint.position, joint.joint.rotation));
  if (const auto body = body_of(joint)) {
    const Eigen::Matrix3d& i = body->inertia;
    xml.open("inertial");
    xml.element("pose", numbers(body->com) + " 0 0 0");
    xml.element("mass", number(body->mass));
    xml.open("inertia");
    xml.element("ixx", number(i(0, 0)));
    xml.element("ixy", number(i(0, 1)));
    xml.element("ixz", number(i(0, 2)));
    xml.element("iyy", number(i(1, 1)));
    xml.element("iyz", number(i(1, 2)));
    xml.element("izz", number(i(2, 2)));
    xml.close("inertia");
    xml.close("inertial");
  }
  xml.close("link");
}

/// The joint's frame is that of its child; its axis counts from there (SDF 1.7 and later).
void sdf_joint(XmlText& xml, const RobotJoint& joint, const std::string& parent, const JointSpring& spring) {
  xml.open("joint", {{"name", joint.name}, {"type", turns(joint) ? "revolute" : "prismatic"}});
  xml.element("parent", parent);
  xml.element("child", joint.link_name);
  xml.open("axis");
  xml.element("xyz", numbers(vector_of(joint.joint.axis)));
  xml.open("limit");
  if (is_limited(joint)) {
    xml.element("lower", number(joint.lower));
    xml.element("upper", number(joint.upper));
  }
  if (std::isfinite(joint.effort_limit)) xml.element("effort", number(joint.effort_limit));
  if (std::isfinite(joint.velocity_limit)) xml.element("velocity", number(joint.velocity_limit));
  xml.close("limit");
  xml.open("dynamics");
  xml.element("damping", number(joint.actuation.viscous_friction));
  xml.element("friction", number(joint.actuation.coulomb_friction));
  if (spring.stiffness != 0.0) {
    xml.element("spring_reference", number(spring.rest));
    xml.element("spring_stiffness", number(spring.stiffness));
  }
  xml.close("dynamics");
  xml.close("axis");
  xml.close("joint");
}

std::string sdf(const Robot& robot) {
  XmlText xml;
  xml.open("sdf", {{"version", "1.7"}});
  xml.open("model", {{"name", robot.name}});
  xml.open("link", {{"name", robot.base_link}});
  xml.close("link");
  xml.open("joint", {{"name", robot.base_link + "_mount"}, {"type", "fixed"}});
  xml.element("parent", "world");
  xml.element("child", robot.base_link);
  xml.close("joint");
  std::string parent = robot.base_link;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    sdf_link(xml, joint, parent);
    sdf_joint(xml, joint, parent, spring_of(robot, j));
    parent = joint.link_name;
  }
  xml.open("frame", {{"name", robot.tip_link + "_frame"}, {"attached_to", parent}});
  xml.element("pose", pose(robot.tip_position, robot.tip_rotation));
  xml.close("frame");
  xml.close("model");
  xml.close("sdf");
  return "<?xml version=\"1.0\"?>\n" + xml.text();
}

struct RobotWriter {
  RobotFormat format;
  std::string (*write)(const Robot&);
  Places places;
};

constexpr std::array<RobotWriter, 3> kRobotWriters{{
    {{"urdf", "URDF"}, urdf, {}},
    {{"mjcf", "MuJoCo's MJCF"}, mjcf, {.rotor_inertia = true, .spring = true, .gravity = true}},
    {{"sdf", "SDF (Gazebo)"}, sdf, {.rotor_inertia = false, .spring = true, .gravity = false}},
}};

constexpr auto kRobotFormats = [] {
  std::array<RobotFormat, kRobotWriters.size()> formats;
  for (std::size_t k = 0; k < formats.size(); ++k) formats[k] = kRobotWriters[k].format;
  return formats;
}();

}  // namespace

std::span<const RobotFormat> robot_formats() { return kRobotFormats; }

RobotText to_text(const Robot& robot, std::string_view format) {
  const auto found = std::find_if(kRobotWriters.begin(), kRobotWriters.end(),
                                  [&](const RobotWriter& writer) { return writer.format.id == format; });
  if (found == kRobotWriters.end()) {
    std::vector<std::string_view> ids;
    for (const RobotFormat& known : kRobotFormats) ids.push_back(known.id);
    throw InputError(
        fmt::format("no robot can be written as '{}'; expected one of {}", format, fmt::join(ids, ", ")));
  }
  refuse_unfit(robot);
  return {found->write(robot), left_out(robot, found->places)};
}

}  // namespace heft::exchange
