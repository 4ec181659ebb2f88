/// @file
/// Can a gear have this value? Ranges of what robot joints with strain-wave gears are like, each with what it rests on.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/model/robot.hpp"

namespace heft::plausibility {

/// Values of a class of gears, as multiples of the joint's largest torque where `per_torque` is true.
struct GearRange {
  const char* effect;     ///< id of the effect
  const char* parameter;  ///< by the name of the effect's kParameters
  double low, high;
  bool per_torque;
  const char* source;  ///< what the range rests on
};

/// The ranges, all of strain-wave gears of robot joints. They are rules of thumb of the order that makers' data have, wide on
/// purpose and not taken from one catalogue: a value outside asks for a second look, no more.
///
/// Stiffness: component sets have a torsional stiffness of some hundred times the repeated peak torque a radian; bearings,
/// housings and joint torque sensors in series make it softer. Load friction: efficiencies of 55 to 95 % are 5 to 45 % of
/// the load as friction. Friction at low speed: some per cent of the peak torque; from a third on the joint would not move
/// under its own load. Rotor inertia: a motor of the drive's own size reaches its peak torque at angular accelerations of
/// 20 to 2000 rad/s² on the joint side.
const std::vector<GearRange>& strain_wave_ranges();

/// Outcome of a look at one effect's parameters.
struct GearCheck {
  enum class Outcome { kUnknown, kPlausible, kImplausible };
  Outcome outcome{
      Outcome::
          kUnknown};  ///< kUnknown: no range for this effect, or the joint's largest torque is not stated
  /// "stiffness 9000 N·m/rad, of strain-wave joints of this size 1600 to 4.5e4"; of an implausible effect what is outside
  /// its range alone; empty: unknown.
  std::string words;
};

/// @param parameters  by the names of the effect's kParameters, SI
GearCheck check_gear(EffectKind effect, const std::vector<std::pair<std::string, double>>& parameters,
                     const model::RobotJoint& joint);

}  // namespace heft::plausibility
