/// @file
/// What one log says of a drive: how its current, or its measured torque, goes with the controller's target torque.
#pragma once

#include <string>
#include <vector>

#include "heft/data/log_set.hpp"
#include "heft/host/numbers.hpp"

namespace heft::drive {

/// The slope of a drive's signal on the target torque of one joint, with its uncertainty.
struct Slope {
  double value{kNaN};  ///< signal per target torque; NaN: the log does not show it
  double std{kNaN};    ///< residuals correlated in time accounted for
  double factor{0.0};  ///< half-width of the 95 % interval in standard deviations
  /// Friction that grows with the load, as a share of the target torque; NaN: not estimated.
  double load_friction{kNaN};
  bool opposite{
      false};  ///< the signal falls as the target torque rises: no constant does that, a flipped sign does

  bool known() const { return value == value; }
};

/// Slopes at standstill of all joints: target current over target torque, medians.
/// @param signal  "iref"
/// @return one a joint; not known where no standstill loads the joint
std::vector<Slope> slopes_at_rest(const data::LogSource& log, const std::string& signal);

/// Slopes while the joint moves, friction estimated with them: the equation of from_targets().
/// @param signal  "iref", "i" or "tau"
std::vector<Slope> slopes_in_motion(const data::LogSource& log, const std::string& signal);

/// Mean of slopes from several logs with the scatter from log to log in its uncertainty.
struct Combined {
  double value{kNaN}, std{kNaN};
  double between{0.0};  ///< standard deviation from log to log beyond what the logs' own uncertainty explains
};
/// Random-effects mean (DerSimonian and Laird 1986).
/// @pre every slope is known
Combined combine(const std::vector<Slope>& slopes);

}  // namespace heft::drive
