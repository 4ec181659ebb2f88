/// @file
/// Can a gear have this value? Ranges of what robot joints with strain-wave gears are like, each with its source.
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
  const char* source;
};

/// The ranges, all of strain-wave gears of robot joints.
///
/// Stiffness: catalogues of component sets of sizes 14 to 58 state torsional stiffness K1 to K3 of 160 to 450 times the
/// repeated peak torque (Harmonic Drive SE, engineering data HFUC-2A: size 20, ratio 100: 1.6 to 2.9e4 N·m/rad at 82 N·m;
/// size 32: 6.7 to 12e4 at 333 N·m); bearings, housings and joint torque sensors in series make it softer: a factor of 5
/// below, 2 above. Load friction: efficiencies of 55 to 95 % (the same data, over ratio, speed and temperature) are 5 to
/// 45 % of the load as friction. Friction at low speed: starting torques and breakaway of geared joints are some percent
/// of the peak torque (H. D. Taghirad, P. R. Bélanger, ASME J. Dyn. Sys. Meas. Control 120, 1998); from a third on the joint would not move under its own
/// load. Rotor inertia: a motor of the drive's own size reaches its peak torque at angular accelerations of 20 to
/// 2000 rad/s² on the joint side.
const std::vector<GearRange>& strain_wave_ranges();

/// Outcome of a look at one effect's parameters.
struct GearCheck {
  enum class Outcome { kUnknown, kPlausible, kImplausible };
  Outcome outcome{
      Outcome::
          kUnknown};  ///< kUnknown: no range for this effect, or the joint's largest torque is not stated
  std::string
      words;  ///< "stiffness 9000 N·m/rad, of strain-wave joints of this size 1600 to 4.5e4"; empty: unknown
};

/// @param parameters  by the names of the effect's kParameters, SI
GearCheck check_gear(EffectKind effect, const std::vector<std::pair<std::string, double>>& parameters,
                     const model::RobotJoint& joint);

}  // namespace heft::plausibility
