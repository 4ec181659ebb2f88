#include "heft/report/exchange.hpp"

#include <cmath>

#include <fmt/format.h>

#include "effect_words.hpp"

namespace heft::report {
namespace {

/// An effect's name, or that of another part of a robot.
std::string name_of(const std::string& what) {
  if (what == "friction_offset") return "friction offset";
  if (what == "gear_coupling") return "coupling of two motors";
  if (what == "elasticity") return "elasticity";
  if (what == "delay") return "delay of the torque channel";
  if (what == "gravity") return "gravity of the turned base";
  std::string name = what;
  const int kind = joint_effect_kind(what);
  visit_joint_effect(kind, [&](auto effect) { name = effect_name(EffectKind(effect)); });
  return name;
}

}  // namespace

std::string full(const payload::Payload& load, const exchange::LoadFormat& format, const std::string& text) {
  return fmt::format("\n{}, {}{}:\n{}", format.title, format.reference,
                     load.has_inertia() ? "" : "; a point, as the log determines no inertia that a body can have",
                     text);
}

std::string full(const exchange::RobotText& written, const exchange::RobotFormat& format,
                 const model::Robot& robot) {
  if (written.left_out.empty()) return "";
  std::string text = fmt::format("Left out, as {} has no place for it:\n", format.title);
  for (const exchange::LeftOut& left : written.left_out) {
    const std::string where = left.joint < 0
                                  ? ""
                                  : fmt::format(" of joint {} ({})", left.joint + 1,
                                                robot.joints[static_cast<std::size_t>(left.joint)].name);
    text += fmt::format("  {}{}", name_of(left.what), where);
    if (std::isfinite(left.share))
      text += fmt::format(": {:.2g} % of the joint's torque on a typical motion", 100.0 * left.share);
    text += "\n";
  }
  return text;
}

}  // namespace heft::report
