/// @file
/// What the torque of an arm holds that is not linear in its 14 n parameters: gear couplings, joint effects, elastic
/// joints, a late torque channel.
#pragma once

#include <deque>
#include <memory>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/model/robot.hpp"

namespace heft::payload {

/// The log with its motion as late as its torque, so that what is computed from a row's motion belongs to the row's
/// torque: positions and velocities as they were `delay` before, by straight lines between rows; before the log begins,
/// those of its first row.
/// @param delay  of the torque channel [s]
data::Log with_late_motion(data::Log log, double delay);

/// The same row by row.
class LateMotion {
 public:
  explicit LateMotion(double delay) : delay_(delay) {}
  /// Replaces the motion of the next row by that of `delay` before.
  /// @param qd  may be empty, then in all rows
  void take(double time, Eigen::VectorXd& q, Eigen::VectorXd& qd);

 private:
  struct Row {
    double time;
    Eigen::VectorXd q, qd;
  };
  double delay_;
  std::deque<Row> rows_;  ///< from the last one that is not later than the moment wanted
};

/// Torque beyond `Y x` (with the inertial columns of Y at the links' motion, the others at the motors'), with the memory
/// of friction and the deflection of elastic joints carried from sample to sample.
/// The model's delay is left out: see with_late_motion().
class BeyondRegressor {
 public:
  explicit BeyondRegressor(const model::Robot& robot);

  /// Whether the robot holds any such torque.
  bool any() const { return whole_ != nullptr; }
  /// @param time        since the log began [s]
  /// @param q,qd,qdd    n, motor side
  /// @param sign_width  of friction's sign [rad/s, m/s]
  /// @return n [N·m, N]
  /// @pre any()
  Eigen::VectorXd torque(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                         const Eigen::VectorXd& qdd, double sign_width);
  /// Motion of the links at the last call: that of the motors, but for elastic joints. It is the unloaded arm's; what a
  /// load bends the joints by in addition is left out.
  Eigen::VectorXd link_q() const { return whole_->link_q().row(0).transpose(); }
  Eigen::VectorXd link_qd() const { return whole_->link_qd().row(0).transpose(); }
  Eigen::VectorXd link_qdd() const { return whole_->link_qdd().row(0).transpose(); }

 private:
  std::unique_ptr<model::MotionTorque> whole_;
  std::unique_ptr<model::Dynamics> linear_;
  bool elastic_{false};
};

}  // namespace heft::payload
