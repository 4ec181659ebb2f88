/// @file
/// Forward dynamics of a serial arm by the articulated-body algorithm.
/// Derivation: src/sim/forward_dynamics.md
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::sim {

/// A rigid body in the last link frame, for instance a load in the gripper.
struct Body {
  double mass{0.0};                              ///< [kg]
  Eigen::Vector3d com{Eigen::Vector3d::Zero()};  ///< centre of mass in the last link frame [m]
  /// About the centre of mass, axes of the last link frame [kg·m²].
  Eigen::Matrix3d inertia{Eigen::Matrix3d::Zero()};
};

/// Ten inertial parameters of a body about the origin of the last link frame.
InertialParameters<double> inertial_parameters(const Body& body);

/// A force and a moment on the last link, both in the base frame.
struct Wrench {
  Eigen::Vector3d force{Eigen::Vector3d::Zero()};   ///< [N], on the robot, through the tip's origin
  Eigen::Vector3d moment{Eigen::Vector3d::Zero()};  ///< [N·m]
};

/// Forward dynamics q̈ = M⁻¹(τ − h(q, q̇)) of a rigid arm, and its energies.
///
/// Written apart from core's recursion so that the two can check each other: core works in link frames
/// from parameters to torque, this class in base axes with a reference point on each joint axis, from
/// torque to acceleration (articulated-body algorithm, Featherstone, Rigid Body Dynamics Algorithms,
/// 2008, ch. 7, with classical instead of spatial accelerations).
///
/// Joint friction is not part of it: pass the net torque of the drive. The rotor inertia of each joint is.
/// A joint can be locked: it then keeps its velocity of zero and transmits whatever torque that needs. Any
/// number of joints can be locked at once; the algorithm solves them together in the same O(n) pass.
///
/// Cost O(n), no allocation after construction. An object holds its own scratch: one object per thread.
class ForwardDynamics {
 public:
  /// @throws ModelError when the robot has no joint, a joint axis is not of unit length or a link's mass is
  ///         negative or not finite.
  explicit ForwardDynamics(const model::Robot& robot);
  ~ForwardDynamics();
  ForwardDynamics(ForwardDynamics&&) noexcept;
  ForwardDynamics& operator=(ForwardDynamics&&) noexcept;

  int num_joints() const;

  /// Acceleration of gravity in the base frame [m/s²].
  void set_gravity(const Eigen::Vector3d& gravity);
  Eigen::Vector3d gravity() const;

  /// Inertia of a joint's rotor on the joint's side [kg·m², kg], in place of the robot's.
  void set_rotor_inertia(int joint, double inertia);
  double rotor_inertia(int joint) const;

  /// Fixes a body to the last link, in place of the one before.
  void attach(const Body& body);
  /// Takes the body off.
  void detach();
  /// Inertial parameters of the attached body about the last link frame's origin; zero without one.
  const InertialParameters<double>& payload() const;

  /// Joint accelerations.
  /// @param q,qd    positions and velocities, n [rad, rad/s; m, m/s on a prismatic joint]
  /// @param tau     torque on the link side without friction, n [N·m, N]
  /// @param locked  n flags, or null when no joint is locked. A locked joint's qd must be zero.
  /// @param wrench  force on the last link in the base frame, or null
  /// @param qdd     out, n; zero on locked joints
  /// @param excess  out, n, or null: on a locked joint the torque that the lock has to take up, with the sign
  ///                in which the joint would start to move if it were free; zero elsewhere
  void acceleration(const double* q, const double* qd, const double* tau, const bool* locked,
                    const Wrench* wrench, double* qdd, double* excess) const;

  /// The same for free joints and Eigen vectors.
  Eigen::VectorXd acceleration(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                               const Eigen::VectorXd& tau) const;

  /// Torque that holds the arm at rest at q, n. Payload included.
  Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q) const;

  /// Kinetic energy, rotors and payload included [J].
  double kinetic_energy(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const;
  /// Potential energy in the gravity field, zero for masses at the base origin [J].
  double potential_energy(const Eigen::VectorXd& q) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::sim
