/// @file
/// Rows that no such arm can have: faults of the measurement.
#pragma once

#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::payload {

/// What a row can hold, from the robot's limits.
class RowLimits {
 public:
  explicit RowLimits(const model::Robot& robot) : torque_(robot.num_joints()), velocity_(robot.num_joints()) {
    for (Eigen::Index i = 0; i < torque_.size(); ++i) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(i)];
      torque_[i] = kFarBeyond * joint.effort_limit;
      velocity_[i] = kFarBeyond * joint.velocity_limit;
    }
  }

  /// The first joint whose torque, velocity or step is not finite or further beyond its limits than descriptions are wrong; -1: none.
  /// @param q,tau  of the row, n [rad, m; N·m, N]
  /// @param qd     velocities, n; size 0: not measured [rad/s, m/s]
  /// @param step   since the row before, n [rad, m]
  /// @param time   since the row before; 0: there was none, and `step` does not count [s]
  template <typename Position, typename Velocity, typename Torque, typename Step>
  int implausible_joint(const Position& q, const Velocity& qd, const Torque& tau, const Step& step,
                        double time) const {
    for (Eigen::Index i = 0; i < torque_.size(); ++i) {
      const bool possible = std::isfinite(q[i]) && is_within(tau[i], torque_[i]) &&
                            (qd.size() == 0 || is_within(qd[i], velocity_[i])) &&
                            (!(time > 0.0) || is_within(step[i], velocity_[i] * time));
      if (!possible) return static_cast<int>(i);
    }
    return -1;
  }

 private:
  /// In parts of the limits [1].
  static constexpr double kFarBeyond = 5.0;

  static bool is_within(double value, double limit) {
    return std::isfinite(value) && std::abs(value) <= limit;
  }

  Eigen::VectorXd torque_, velocity_;
};

}  // namespace heft::payload
