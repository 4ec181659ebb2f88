#include "heft/plausibility/gear.hpp"

#include <cmath>

#include <fmt/format.h>

namespace heft::plausibility {

const std::vector<GearRange>& strain_wave_ranges() {
  static const std::vector<GearRange> ranges{
      {"elasticity", "stiffness", 30.0, 900.0, true, "rule of thumb"},
      {"load_friction", "mu", 0.05, 0.45, false, "rule of thumb: efficiency of 55 to 95 %"},
      {"stribeck", "Fs", 0.0, 0.33, true, "starting torque"},
      {"rotor_inertia", "Ia", 1.0 / 2000.0, 1.0 / 20.0, true, "peak torque over inertia"},
      {"elasticity", "motor_inertia", 0.0, 1.0 / 20.0, true, "peak torque over inertia"},
      {"offset", "tau0", -0.33, 0.33, true, "starting torque"}};
  return ranges;
}

GearCheck check_gear(EffectKind effect, const std::vector<std::pair<std::string, double>>& parameters,
                     const model::RobotJoint& joint) {
  std::string plausible, implausible;
  if (joint.joint.type != JointType::kRevolute) return {};
  for (const GearRange& range : strain_wave_ranges()) {
    if (effect.id() != range.effect) continue;
    const bool sized = std::isfinite(joint.effort_limit) && joint.effort_limit > 0.0;
    if (range.per_torque && !sized) continue;
    const double size = range.per_torque ? joint.effort_limit : 1.0;
    for (const auto& [name, value] : parameters) {
      if (name != range.parameter || !std::isfinite(value)) continue;
      const bool within = value >= range.low * size && value <= range.high * size;
      const EffectParameter* unit = effect.parameter(name);
      const std::string in = unit == nullptr || unit->unit == "1" ? "" : " " + std::string(unit->unit);
      std::string& words = within ? plausible : implausible;
      if (!words.empty()) words += "; ";
      words += fmt::format("{} {:.3g}{}, of strain-wave joints of this size {:.2g} to {:.2g} ({})", name, value, in,
                           range.low * size, range.high * size, range.source);
    }
  }
  if (!implausible.empty()) return {GearCheck::Outcome::kImplausible, implausible};
  if (!plausible.empty()) return {GearCheck::Outcome::kPlausible, plausible};
  return {};
}

}  // namespace heft::plausibility
