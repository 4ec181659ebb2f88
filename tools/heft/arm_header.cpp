#include "arm_header.hpp"

#include <array>
#include <cctype>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::tools {
namespace {

bool is_identifier(const std::string& name) {
  static const std::set<std::string> kReserved{"class", "struct",  "template", "float",  "double",
                                               "int",   "default", "new",      "delete", "namespace",
                                               "heft",  "public",  "private",  "this",   "auto"};
  if (name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) || kReserved.contains(name))
    return false;
  for (const char c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_') return false;
  }
  return true;
}

/// Shortest text that reads back to the same double.
std::string literal(double value) { return fmt::format("{}", value == 0.0 ? 0.0 : value); }

/// Numbers of a rotation or axis: what differs from 0 or ±1 by rounding alone is written exactly.
double snapped(double value) {
  constexpr double kRounding = 1e-12;
  for (const double exact : {0.0, 1.0, -1.0}) {
    if (std::abs(value - exact) < kRounding) return exact;
  }
  return value;
}

template <typename Values>
std::string braces(const Values& values, bool snap) {
  std::string text = "{";
  for (std::size_t k = 0; k < values.size(); ++k) {
    text += (k ? ", " : "") + literal(snap ? snapped(values[k]) : values[k]);
  }
  return text + "}";
}

/// A text that is safe inside a line comment and a string literal.
std::string plain(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    safe += (static_cast<unsigned char>(c) < 0x20 || c == '\\' || c == '"') ? '_' : c;
  }
  return safe;
}

/// A constant list, an entry a line.
std::string list_text(const std::string& type, const std::string& name,
                      const std::vector<std::string>& entries) {
  std::string text =
      fmt::format("  static constexpr std::array<heft::{}<double>, {}> {}{{", type, entries.size(), name);
  if (entries.empty()) return text + "};\n";
  text += "{\n";
  for (const std::string& entry : entries) text += fmt::format("      {},\n", entry);
  return text + "  }};\n";
}

/// The motion that an effect was seen in, behind its parameters; empty: it has no limits.
std::string seen_text(const SeenWithin<double>& seen) {
  bool any = false;
  std::string text;
  for (const SeenInterval<double>& interval : {seen.velocity, seen.load, seen.position, seen.temperature}) {
    const bool limited = is_limited(interval);
    any = any || limited;
    text += fmt::format("{}{}", text.empty() ? "" : ", ",
                        limited ? fmt::format("{{{}, {}}}", literal(interval.low), literal(interval.high))
                                : "{}");
  }
  return any ? fmt::format(", heft::Displacement::kPosition,\n       {{{}}}", text) : "";
}

/// Gear couplings, joint effects, elastic joints and delay; joints counted from 0.
std::string effects_text(const model::Robot& robot) {
  std::vector<std::string> couplings, cables, effects, elasticities;
  for (const GearCoupling<double>& c : robot.couplings) {
    couplings.push_back(fmt::format("{{{}, {}, {}, {}, {}, {}}}", c.driving, c.driven, literal(c.ratio),
                                    literal(c.rotor_inertia), literal(c.coulomb_friction),
                                    literal(c.viscous_friction)));
  }
  for (const JointCable<double>& c : robot.cables) {
    cables.push_back(
        fmt::format("{{{}, {}, {}, {}, {}, {}}}", c.driving, c.driven, literal(c.ratio), literal(c.stiffness),
                    literal(c.neutral),
                    is_limited(c.seen) ? fmt::format("{{{}, {}}}", literal(c.seen.low), literal(c.seen.high)) : "{}"));
  }
  for (const JointEffect<double>& effect : robot.effects) {
    visit_joint_effect(effect.kind, [&](auto type) {
      using Effect = decltype(type);
      std::string values, meaning;
      std::size_t i = 0;
      for (const EffectParameter& parameter : Effect::kParameters) {
        values += (i > 0 ? ", " : "") + literal(effect.parameters[i]);
        meaning += fmt::format("{}{}", i > 0 ? ", " : "", parameter.name);
        ++i;
      }
      const std::string seen = seen_text(effect.seen);
      if (!seen.empty()) meaning += "; seen within velocity, load, position";
      effects.push_back(fmt::format("// {}: {}\n      {{heft::joint_effect_kind(\"{}\"), {}, {{{}}}{}}}",
                                    Effect::kEquation, meaning, Effect::kId, effect.joint, values, seen));
    });
  }
  for (const Elasticity<double>& e : robot.elasticities) {
    elasticities.push_back(fmt::format("{{{}, {}, {}, {}{}}}", e.joint, literal(e.stiffness), literal(e.damping),
                                       literal(e.motor_inertia), e.gap > 0.0 ? ", " + literal(e.gap) : ""));
  }
  return "  /// Motors that turn with two joints: driving, driven, ratio, rotor inertia, Coulomb, "
         "viscous.\n" +
         list_text("GearCoupling", "kCouplings", couplings) +
         (cables.empty() ? ""
                         : "  /// Cables over two joints: driving, driven, ratio, stiffness, neutral position, stretch seen.\n" +
                               list_text("JointCable", "kCables", cables)) +
         "  /// What else acts at joints, for heft::EffectFeedForward: kind, joint, parameters.\n" +
         list_text("JointEffect", "kEffects", effects) +
         "  /// Elastic joints: joint, stiffness, damping, motor inertia, play.\n" +
         list_text("Elasticity", "kElasticities", elasticities) +
         "  /// The torque channel reports the torque of this long ago [s].\n" +
         fmt::format("  static constexpr double kTorqueDelay = {};\n", literal(robot.torque_delay));
}

/// Thresholds of contacts, for heft::ContactMonitor.
std::string thresholds_text(const monitor::Thresholds& thresholds) {
  std::string text = fmt::format(
      "  /// Thresholds of contacts, for heft::ContactMonitor: moving, turning, rest, the same of the change,\n"
      "  /// rest speed, top speed.\n"
      "  static constexpr heft::ContactThresholds<double, {}> kThresholds{{\n"
      "      .bandwidth = {},\n      .adaptation = {},\n      .turning_time = {},\n      .load_rate = {},\n"
      "      .largest_step = {},\n      .joints = {{{{\n",
      thresholds.joints.size(), literal(thresholds.bandwidth), literal(thresholds.adaptation),
      literal(thresholds.turning_time), literal(thresholds.load_rate), literal(thresholds.largest_step));
  for (const JointThreshold<double>& j : thresholds.joints) {
    std::array<double, monitor::kThresholdFields.size()> values{};
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = j.*monitor::kThresholdFields[i].value;
    text += fmt::format("          {},\n", braces(values, false));
  }
  return text + "      }}};\n";
}

}  // namespace

std::string type_name_of(const std::string& robot_name) {
  std::string name;
  bool upper = true;
  for (const char c : robot_name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) {
      upper = true;
      continue;
    }
    name += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    upper = false;
  }
  if (name.empty()) return "Arm";
  return std::isdigit(static_cast<unsigned char>(name[0])) ? "Arm" + name : name;
}

std::string arm_header(const model::Robot& robot, const ArmHeaderNames& names,
                       const monitor::Thresholds* thresholds) {
  if (!is_identifier(names.type)) {
    throw InputError(fmt::format("--name: found \"{}\"; expected a C++ type name such as {}", names.type,
                                 type_name_of(robot.name)));
  }
  for (std::size_t from = 0; !names.name_space.empty();) {
    const std::size_t colons = names.name_space.find("::", from);
    if (!is_identifier(names.name_space.substr(from, colons - from))) {
      throw InputError(fmt::format(
          "--namespace: found \"{}\"; expected C++ names joined by ::, such as app::arms", names.name_space));
    }
    if (colons == std::string::npos) break;
    from = colons + 2;
  }

  std::string text = fmt::format(
      "/// @file\n/// Robot \"{}\" with {} joints, written by `heft export` from {}.\n/// Do not edit: "
      "export again.\n"
      "#pragma once\n\n#include <array>\n\n#include \"heft/core/arm_model.hpp\"\n"
      "{}#include \"heft/core/effects/effects.hpp\"\n#include \"heft/core/effects/elasticity.hpp\"\n"
      "#include \"heft/core/friction/gear_coupling.hpp\"\n{}\n",
      plain(robot.name), robot.num_joints(), plain(names.source_of_truth),
      robot.cables.empty() ? "" : "#include \"heft/core/effects/cable.hpp\"\n",
      thresholds != nullptr ? "#include \"heft/core/monitor/contact_thresholds.hpp\"\n" : "");
  if (!names.name_space.empty()) text += fmt::format("namespace {} {{\n\n", names.name_space);
  text +=
      fmt::format("/// Chain from {} to {}. SI units; inertia about the link-frame origin.\nstruct {} {{\n",
                  plain(robot.base_link), plain(robot.tip_link), names.type);
  const int n = robot.num_joints();
  text += fmt::format("  static constexpr heft::ArmModel<double, {}> kModel{{\n", n);
  text += "      // type, rotation (row-major), position [m], axis\n      .joints = {{\n";
  for (const model::RobotJoint& joint : robot.joints) {
    text += fmt::format(
        "          // {}\n          {{heft::JointType::{},\n           {},\n           {},\n           "
        "{}}},\n",
        plain(joint.name), joint.joint.type == JointType::kRevolute ? "kRevolute" : "kPrismatic",
        braces(joint.joint.rotation, true), braces(joint.joint.position, false),
        braces(joint.joint.axis, true));
  }
  text += "      }},\n      // m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz\n      .links = {{\n";
  for (const model::RobotJoint& joint : robot.joints) {
    text +=
        fmt::format("          {},  // {}\n", "{" + braces(joint.link, false) + "}", plain(joint.link_name));
  }
  text += "      }},\n      // rotor inertia, Coulomb, viscous, offset\n      .actuation = {{\n";
  for (const model::RobotJoint& joint : robot.joints) {
    const auto& a = joint.actuation;
    text +=
        fmt::format("          {},\n", braces(std::array<double, 4>{a.rotor_inertia, a.coulomb_friction,
                                                                    a.viscous_friction, a.friction_offset},
                                              false));
  }
  text += fmt::format("      }}}},\n      .gravity = {},\n  }};\n", braces(robot.gravity, false));
  text += "  /// Placement of the tool flange in the last link frame: rotation (row-major), position [m].\n";
  text += fmt::format("  static constexpr std::array<double, 9> kTipRotation{};\n",
                      braces(robot.tip_rotation, true));
  text += fmt::format("  static constexpr std::array<double, 3> kTipPosition{};\n",
                      braces(robot.tip_position, false));
  text += effects_text(robot);
  if (thresholds != nullptr) text += thresholds_text(*thresholds);
  text += "};\n";
  if (!names.name_space.empty()) text += fmt::format("\n}}  // namespace {}\n", names.name_space);
  return text;
}

}  // namespace heft::tools
