/// @file
/// Core's run-time dynamics behind run-time sizes, for the command and the host rooms.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "heft/model/sign_width.hpp"

namespace heft::model {

/// Largest number of joints the host instantiates core for.
inline constexpr int kMaxJoints = 10;

/// Dynamics of a robot for vectors sized at run time; forwards to core's templates for N = 1..kMaxJoints.
/// All torques on the link side [N·m, N on a prismatic joint], sign along positive q.
class Dynamics {
 public:
  /// @throws ModelError when the robot has no joint or more than kMaxJoints, or an effect or elasticity that
  ///         no joint can have: of a joint or kind that does not exist, a stiffness that is not positive.
  explicit Dynamics(const Robot& robot);
  ~Dynamics();
  Dynamics(Dynamics&&) noexcept;
  Dynamics& operator=(Dynamics&&) noexcept;

  int num_joints() const;
  const Robot& robot() const;

  /// Rigid-body inverse dynamics with gravity, without actuation terms. All n.
  Eigen::VectorXd inverse_dynamics(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                   const Eigen::VectorXd& qdd) const;
  /// inverse_dynamics plus rotor inertia, Coulomb (sign, 0 at standstill), viscous and offset terms, gear
  /// couplings and joint effects: everything that one instant determines. What depends on more is left to
  /// MotionTorque; here friction has turned over at once after a reversal (no hysteresis), a joint that warms up
  /// is cold, an elastic joint is rigid with its motor's inertia, and the torque channel has no delay.
  /// @param sign_width  the sign becomes tanh(velocity / width), for joints that rest with a noisy velocity; as in
  ///                    velocity_sign
  Eigen::VectorXd joint_torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                               const Eigen::VectorXd& qdd, const SignWidth& sign_width = {}) const;
  /// Gravity torque g(q).
  Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q) const;
  /// Joint-space mass matrix of the rigid bodies (no rotor inertia), n × n.
  Eigen::MatrixXd mass_matrix(const Eigen::VectorXd& q) const;
  /// Full regressor n × 14n: ten columns a link, then blocks rotor inertia, Coulomb, viscous, offset.
  Eigen::MatrixXd regressor(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                            const Eigen::VectorXd& qdd) const;
  /// The 14n parameters that go with regressor(); gear couplings are not among them.
  Eigen::VectorXd parameters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::model
