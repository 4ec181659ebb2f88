/// @file
/// Torque of a robot along a sampled motion, with everything that one instant does not determine.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"

namespace heft::model {

/// A log's first stretch, in which a joint at rest is seen to be held [s].
inline constexpr double kSeenAtRest = 0.5;
/// A joint that stays below this speed is at rest [rad/s, m/s].
inline constexpr double kRestSpeed = 5e-3;

/// Whether friction of this robot remembers by a displacement as logged instead of by the derived position: then
/// MotionTorque::torque wants `measured`.
bool needs_measured_displacement(const Robot& robot);
/// Whether the torque of a row depends on rows before it: by a memory, a deflection or a delay.
bool depends_on_past(const Robot& robot);
/// Whether friction of this robot follows the temperature of a joint: then it wants `temperature`.
bool needs_temperature(const Robot& robot);

/// Motor torque along a motion, with everything that a Robot holds: rigid bodies, actuation, gear couplings,
/// joint effects (those with memory are carried from row to row), elastic joints and the delay of the torque
/// channel. Without memory, drift, elasticity and delay every row is Dynamics::joint_torque.
///
/// Elastic joints: q is the motor's position θ; the deflection e = θ - x follows from
///   M_ee(x) ë = τ_rigid(x, ẋ, θ̈) - K e - D ė
/// over the elastic joints, integrated from row to row from static equilibrium, so that no torque has to be
/// differentiated. The motor brings up J_m θ̈ + friction(θ̇) + K e + D ė, the other joints rigid body(x, ẋ, ẍ).
/// Inertia and rigid-body torque are taken once a row, with straight lines between rows. Across rows so far
/// apart that the joint rings dozens of times between them, it is taken to have come to rest.
///
/// Joint effects see the motor's motion; the load of an elastic joint is what its spring and damper transmit.
class MotionTorque {
 public:
  /// @throws ModelError as Dynamics, or for an elastic joint that does not exist, is named twice or has no
  ///         positive stiffness, or for a delay below 0.
  explicit MotionTorque(const Robot& robot);
  ~MotionTorque();
  MotionTorque(MotionTorque&&) noexcept;
  MotionTorque& operator=(MotionTorque&&) noexcept;

  /// Torque of every row. State (memory, deflection, rows that a delay looks back to) goes on from the call
  /// before until reset(), so that a motion may come in pieces; its first row continues the last one before.
  /// @param time        m, increasing, not necessarily even [s]; 0 is where effects that depend on time begin, so
  ///                    hand in the time since the log began
  /// @param q,qd,qdd    m × n, motor side
  /// @param sign_width  as in Dynamics::joint_torque
  /// @param measured    m × 2 n, displacements since the row before that an effect's memory goes by where it names
  ///                    one of them, see displacement_column(); no columns: those of q [rad, m]
  /// @param temperature m × n, of the joints [°C]; no columns, or not a number: not known, and friction that goes by it is
  ///                    that at its T0
  /// @return m × n [N·m, N]. With a delay each row is read `torque_delay` earlier, by straight lines between
  ///         rows; the first rows after reset(), which have nothing earlier, take the first one.
  Eigen::MatrixXd torque(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd,
                         const Eigen::MatrixXd& qdd, const SignWidth& sign_width = {},
                         const Eigen::MatrixXd& measured = {}, const Eigen::MatrixXd& temperature = {});
  /// Link-side motion of the last call, m × n each: q, qd, qdd unless a joint is elastic.
  const Eigen::MatrixXd& link_q() const;
  const Eigen::MatrixXd& link_qd() const;
  const Eigen::MatrixXd& link_qdd() const;
  /// Forgets memory and deflection.
  void reset();
  /// Resets, and begins friction's memory (Hysteresis) where the log shows it: a joint that rests through the first
  /// kSeenAtRest is held by friction with what is measured there beyond the model. The rows are not predicted;
  /// torque() begins with them.
  /// @param time,q,qd,qdd  as in torque(), the log's first rows; more than kSeenAtRest of them is not looked at
  /// @param tau            m × n, measured [N·m, N]; rows that are not finite leave a joint's memory at 0
  void start_from(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd,
                  const Eigen::MatrixXd& qdd, const Eigen::MatrixXd& tau, const SignWidth& sign_width = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::model
