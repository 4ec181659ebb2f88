/// @file
/// Finite Fourier series: motions with exact derivatives and no content above their last harmonic.
#pragma once

#include <Eigen/Core>

namespace heft::excite {

/// A finite Fourier series per joint:
///
///   q̇_j(t) = Σ_k a_jk sin(kωt) + b_jk cos(kωt),   q_j(0) = start_j,   ω = 2π / period.
///
/// At rest with zero acceleration at both ends when Σ b = 0 and Σ k a = 0 (see ExcitationDesign).
struct ExcitationTrajectory {
  double period{20.0};     ///< of the first harmonic [s]
  double duration{20.0};   ///< [s]
  Eigen::VectorXd start;   ///< n [rad, m]
  Eigen::MatrixXd sine;    ///< a, n × harmonics [rad/s, m/s]
  Eigen::MatrixXd cosine;  ///< b, n × harmonics

  int num_joints() const { return static_cast<int>(start.size()); }
  int num_harmonics() const { return static_cast<int>(sine.cols()); }
  /// @param q,qd,qdd  out, resized to n
  void evaluate(double t, Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& qdd) const;
};

}  // namespace heft::excite
