/// @file
/// What accelerations torques give, for simulations that ask for them at every step.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// Forward dynamics of a robot's rigid bodies with what its drives add to the mass matrix: mass matrix, bias torque and the
/// solution in one call without a heap, at a third of the time of one after the other.
class Acceleration {
 public:
  /// @param drives  n × n, symmetric: added to the mass matrix (rotors, couplings) [kg·m², kg]
  /// @throws ModelError when the robot has no joint or more than kMaxJoints
  Acceleration(const Robot& robot, const Eigen::MatrixXd& drives);
  ~Acceleration();
  Acceleration(Acceleration&&) noexcept;
  Acceleration& operator=(Acceleration&&) noexcept;

  /// n numbers, never on the heap.
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;

  /// (M(q) + drives) q̈ = τ − h(q, q̇), with h the bias torque: Coriolis, centrifugal and gravity.
  /// @param q, qd, torque  n; friction is the caller's
  /// @param qdd            n, filled
  /// @return false, with qdd as it was, where the matrix is not positive definite
  bool solve(const Vector& q, const Vector& qd, const Vector& torque, Vector& qdd) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::model
