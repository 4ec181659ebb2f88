#include "element_writer.hpp"

#include <array>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <urdf_exception/exception.h>
#include <urdf_model/pose.h>
#include <Eigen/Geometry>

#include "rigid_body.hpp"

namespace heft::urdf {
namespace {

/// The shortest text that reads back as the same double. No negative zero.
std::string number(double value) { return fmt::format("{}", value == 0.0 ? 0.0 : value); }

std::string numbers(const Eigen::Vector3d& v) {
  return fmt::format("{} {} {}", number(v[0]), number(v[1]), number(v[2]));
}

std::array<std::pair<const char*, std::string>, 6> entries(const Eigen::Matrix3d& inertia) {
  return {{{"ixx", number(inertia(0, 0))},
           {"ixy", number(inertia(0, 1))},
           {"ixz", number(inertia(0, 2))},
           {"iyy", number(inertia(1, 1))},
           {"iyz", number(inertia(1, 2))},
           {"izz", number(inertia(2, 2))}}};
}

/// Turn of the inertial frame that the element has, when it can be kept: link axes from its axes. Nothing when
/// reading makes it another one (a rounded quarter turn, made exact), since other readers do not.
std::optional<Eigen::Matrix3d> turn_to_keep(const XmlElement& inertial) {
  const XmlElement* origin = inertial.child("origin");
  const std::string* rpy = origin == nullptr ? nullptr : origin->attribute("rpy");
  if (rpy == nullptr) return Eigen::Matrix3d::Identity();
  ::urdf::Pose pose;
  try {
    pose.rotation.init(*rpy);
  } catch (const ::urdf::ParseError&) {
    return std::nullopt;
  }
  const Eigen::Matrix3d turn = placement_of(pose).R;
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  const Eigen::Matrix3d as_written = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  if ((turn - as_written).cwiseAbs().maxCoeff() > 1e-13) return std::nullopt;
  return turn;
}

}  // namespace

void ElementWriter::write_link(const model::RobotJoint& joint) {
  const XmlElement& link = *tree_.links.at(joint.link_name);
  const XmlElement* inertial = link.child("inertial");
  const LinkBody body = to_body(joint.link);
  if (is_zero(joint.link)) {
    if (inertial != nullptr) set_aside(link, *inertial, "heft: this link has no mass");
  } else if (inertial == nullptr) {
    insert_inertial(link, body);
    report_.inserted_links.push_back(joint.link_name);
  } else {
    fill_inertial(joint.link_name, *inertial, body);
    report_.changed_links.push_back(joint.link_name);
  }
  for (const std::string& name : tree_.fixed_to(joint.link_name)) {
    const XmlElement& fixed = *tree_.links.at(name);
    const XmlElement* own = fixed.child("inertial");
    if (own == nullptr) continue;
    set_aside(fixed, *own,
              fmt::format("heft: counted in link \"{}\", which this link is fixed to", joint.link_name));
    report_.notes.push_back(
        fmt::format("link \"{}\" is fixed to \"{}\", which carries the parameters of both; its own "
                    "<inertial> is a comment now",
                    name, joint.link_name));
  }
}

void ElementWriter::write_friction(const model::RobotJoint& joint) {
  const XmlElement& element = *tree_.joints.at(joint.name);
  const std::string damping = number(joint.actuation.viscous_friction);
  const std::string friction = number(joint.actuation.coulomb_friction);
  if (const XmlElement* dynamics = element.child("dynamics")) {
    editor_.set_attribute(*dynamics, "damping", damping);
    editor_.set_attribute(*dynamics, "friction", friction);
  } else {
    const XmlElement* limit = element.child("limit");
    // A joint has children: its parent and child links at least.
    editor_.insert(element, limit != nullptr ? limit : &element.children.back(),
                   {{0, fmt::format("<dynamics damping=\"{}\" friction=\"{}\"/>", damping, friction)}});
  }
  report_.changed_joints.push_back(joint.name);
}

void ElementWriter::insert_inertial(const XmlElement& link, const LinkBody& body) {
  std::string inertia;
  for (const auto& [name, value] : entries(body.about_com)) inertia += fmt::format(" {}=\"{}\"", name, value);
  editor_.insert(link, nullptr,
                 {{0, "<inertial>"},
                  {1, fmt::format("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", numbers(body.com))},
                  {1, fmt::format("<mass value=\"{}\"/>", number(body.mass))},
                  {1, fmt::format("<inertia{}/>", inertia)},
                  {0, "</inertial>"}});
}

void ElementWriter::fill_inertial(const std::string& link_name, const XmlElement& inertial,
                                  const LinkBody& body) {
  const std::optional<Eigen::Matrix3d> kept = turn_to_keep(inertial);
  const XmlElement* origin = inertial.child("origin");
  if (!kept) {
    editor_.set_attribute(*origin, "rpy", "0 0 0");
    report_.notes.push_back(
        fmt::format("link \"{}\": its inertial frame was turned by a rounded angle (rpy); the inertia "
                    "is in link axes now",
                    link_name));
  }
  // I_F = Rᵀ I_c R, in the axes of the inertial frame F; R turns components in F into those in link axes.
  const Eigen::Matrix3d turn = kept.value_or(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d turned = turn.transpose() * body.about_com * turn;
  const std::string place = numbers(body.com);
  if (origin != nullptr) {
    editor_.set_attribute(*origin, "xyz", place);
  } else if (!body.com.isZero(0.0)) {
    editor_.insert(inertial, nullptr, {{0, fmt::format("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", place)}});
  }
  editor_.set_attribute(*inertial.child("mass"), "value", number(body.mass));
  for (const auto& [name, value] : entries(0.5 * (turned + turned.transpose())))
    editor_.set_attribute(*inertial.child("inertia"), name, value);
}

void ElementWriter::set_aside(const XmlElement& link, const XmlElement& inertial, const std::string& why) {
  std::string inside =
      fmt::format("{}: {}", why, text_.substr(inertial.begin, inertial.end - inertial.begin));
  // A comment must not hold two hyphens in a row.
  for (std::size_t at = inside.find("--"); at != std::string::npos; at = inside.find("--", at))
    inside.replace(at, 2, "- -");
  editor_.replace(inertial.begin, inertial.end, fmt::format("<!-- {} -->", inside));
  report_.set_aside_links.push_back(*link.attribute("name"));
}

}  // namespace heft::urdf
