/// @file
/// What the errors of the arm's model do to a load that is estimated recursively.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heft/statistics/interval.hpp"

namespace heft::payload {

/// Sums over the rows that an estimate was made from. With A = P₀⁻¹ + Σ wᵀ w/σ² the load x̂ = A⁻¹ Σ wᵀ (τ − Y z)/(s σ²) of row i depends
/// on the model's parameters z by −A⁻¹ Σ wᵀ Y/(s σ²), and on the torque scale s_i of a joint by −A⁻¹ Σ wᵀ (w x̂)/σ² over the rows of that
/// joint. Parameters: ten of the load about the last link frame, then Coulomb and viscous of each joint, which may have changed.
class ArmError {
 public:
  /// @param prior_variance    of the parameters, 10 + 2 n, > 0
  /// @param model_covariance  of the arm's 14 n parameters; absent: not known
  /// @param drive_scale       measured torque in parts of the true one, one a joint; may be empty
  ArmError(Eigen::VectorXd prior_variance, std::optional<Eigen::MatrixXd> model_covariance,
           std::vector<statistics::Interval> drive_scale);

  /// Another load: its estimate begins with the rows from here on.
  void restart();
  /// One row.
  /// @param regressor  of joint i for the arm, 14 n
  /// @param load       of joint i for the load, 10
  /// @param sign,rate  of the velocity of joint i, and the velocity
  /// @param variance   of the torque's residual [N²·m²]
  /// @param together   rows of this joint that say as much as one, because the residual is correlated in time; ≥ 1
  void add(int i, const Eigen::VectorXd& regressor, const Eigen::VectorXd& load, double sign, double rate,
           double variance, double together);
  /// Covariance of the load for residuals that are as large and as long correlated as without load, 10 × 10:
  /// A⁻¹ (Σ wᵀ w together/σ²) A⁻¹.
  Eigen::MatrixXd residual() const;
  /// Covariance that the model and the torque scale add to that of the load, 10 × 10.
  /// @param load  the estimate
  Eigen::MatrixXd covariance(const Eigen::VectorXd& load) const;

 private:
  Eigen::VectorXd prior_variance_;
  std::optional<Eigen::MatrixXd> model_covariance_;
  std::vector<statistics::Interval> drive_scale_;
  Eigen::MatrixXd inverse() const;

  Eigen::MatrixXd information_, scatter_;  ///< A; the same of rows that come together
  Eigen::MatrixXd dependence_;             ///< Σ wᵀ Y/(s σ²)
  std::vector<Eigen::MatrixXd> pull_;      ///< of each joint: Σ wᵀ w/σ², its columns of the load
};

}  // namespace heft::payload
