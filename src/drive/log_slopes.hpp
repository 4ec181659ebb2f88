/// @file
/// What one log says of a drive: how its current, or its measured torque, goes with the controller's target torque.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/numbers.hpp"

namespace heft::drive {

/// Half-width of an interval beyond which a log does not show the constant, as a share of the value [1].
inline constexpr double kWidestLog = 0.25;
/// The same of the answer, and of a known load: data sheets are as good as this.
inline constexpr double kWidest = 0.1;

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

/// What stands for the motor's torque in a log.
enum class Signal { kTargetCurrent, kCurrent, kTorque };  // iref, i, tau

/// Slopes of all joints in one log.
struct Slopes {
  /// Target current over target torque, medians; not known where no standstill loads the joint.
  std::vector<Slope> at_rest;
  /// While the joint moves, friction estimated with them: the equation of from_targets().
  std::vector<Slope> in_motion;
};

/// A log with target torques, looked through once for what it has and how large that is, once more by slopes().
class DriveLog {
 public:
  explicit DriveLog(const data::LogSource& log);

  /// Target torques of all joints.
  bool has_target() const { return has_[0]; }
  bool has(Signal signal) const { return has_[index(signal)]; }

  /// @pre has_target(), has(signal)
  /// @param at_rest  false: in motion only
  Slopes slopes(Signal signal, bool at_rest) const;

 private:
  static constexpr std::size_t kGroups = 4;  // of columns: target torque, then the signals
  static std::size_t index(Signal signal) { return static_cast<std::size_t>(signal) + 1; }

  data::MotionStream stream_;
  std::array<bool, kGroups> has_{};
  std::array<Eigen::VectorXd, kGroups> largest_;  // absolute values, n each; no elements: not there
  Eigen::VectorXd speed_, acceleration_;          // largest absolute values
};

/// Mean of slopes from several logs with the scatter from log to log in its uncertainty.
struct Combined {
  double value{kNaN}, std{kNaN};
  double between{0.0};  ///< standard deviation from log to log beyond what the logs' own uncertainty explains
};
/// Random-effects mean (DerSimonian and Laird 1986).
/// @pre every slope is known
Combined combine(const std::vector<Slope>& slopes);

}  // namespace heft::drive
