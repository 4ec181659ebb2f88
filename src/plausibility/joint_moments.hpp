/// @file
/// How well a torque fits a joint, from second moments of its regressor: likelihood, slope, and the part that no masses explain.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "samples.hpp"

namespace heft::plausibility {

/// Standard deviations of the link parameters that a robot's description is given, 10 n: a quarter of each mass; each
/// centre of mass by a fifth of its distance and 3 % of the arm's length; a payload of an eighth of the arm on the
/// last link.
Eigen::VectorXd prior_deviations(const model::Robot& robot);

/// Moments of one joint's rows of the regressor against all torques of the log.
///
/// The model of joint j: τ = Y_j (θ + δ) + f_c sign(q̇) + f_v q̇ + I_a q̈ + o, with θ the robot's parameters, δ their
/// error (prior_deviations), friction and rotor inertia not negative, o an offset.
class JointMoments {
 public:
  /// @param deviations  10 n
  JointMoments(const model::Robot& robot, int joint, const std::vector<Eigen::MatrixXd>& regressors,
               const Eigen::VectorXd& deviations, const Samples& samples);

  bool moving() const { return moving_; }
  /// Share of the rows in which the joint rests, 0 to 1.
  double resting() const { return resting_; }
  /// Rows that count as independent: two a second, since residuals of motion are correlated in time.
  double effective_rows() const { return effective_; }
  double torque_rms(int torque) const;
  double expected_rms() const;
  /// Rms residual of a torque when all parameters of the joint's row are free [N·m, N].
  /// @param friction  friction is among them
  double free_residual(int torque, bool friction = true) const;
  /// Minus twice the logarithm of the likelihood that sign × the torque is this joint's: ν ln(1 + χ²/ν) with ν
  /// effective rows and χ² the smallest sum of squares, errors of the parameters and the offset included.
  /// @param noise   standard deviation of the residual
  /// @param offset  standard deviation of the offset
  double misfit(int torque, double sign, double noise, double offset) const;
  /// Power that the friction of a torque takes out, over its standard deviation, when all parameters of the joint's row
  /// and a spring are free; 0 for a joint at rest. Below 0 the friction would drive the joint.
  double dissipation(int torque) const;
  /// Slope of a torque on what the robot's parameters make of it, and its standard deviation.
  std::pair<double, double> slope(int torque, double noise, double offset) const;

 private:
  Eigen::Index tau(int torque) const { return parameters_ + 6 + torque; }

  // Second moments (sums over rows) of [δ columns | 1 | sign | q̇ | q̈ | expected | q | τ_1..τ_n].
  Eigen::MatrixXd moments_;
  Eigen::Index parameters_{0};
  double rows_{0.0}, effective_{0.0};
  bool moving_{false};
  double resting_{0.0};
};

}  // namespace heft::plausibility
