/// @file
/// Regressor and torque at one instant with exact derivatives by positions, velocities and accelerations.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/regression_columns.hpp"

namespace heft::excite {

/// Chosen columns of the regression, smooth sign, and the torque without Coulomb friction.
class DifferentiableRegressor {
 public:
  virtual ~DifferentiableRegressor() = default;

  /// @param Y    out, n × chosen columns
  /// @param tau  out, n: rigid bodies, rotors, viscous friction and offset [N·m, N]
  virtual void evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& qdd,
                        Eigen::Ref<Eigen::MatrixXd> Y, Eigen::Ref<Eigen::VectorXd> tau) const = 0;

  /// Derivatives of Σ_ic G_ic Y_ic + Σ_i h_i τ_i, n each.
  virtual void gradient(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& qdd,
                        const Eigen::Ref<const Eigen::MatrixXd>& G, const Eigen::VectorXd& h,
                        Eigen::VectorXd& by_q, Eigen::VectorXd& by_qd, Eigen::VectorXd& by_qdd) const = 0;
};

/// @param chosen      columns wanted
/// @param sign_width  n: tanh(q̇/width) replaces the sign [rad/s, m/s]
std::unique_ptr<DifferentiableRegressor> make_differentiable_regressor(
    const regression::RegressionColumns& columns, const std::vector<int>& chosen,
    const Eigen::VectorXd& sign_width);

}  // namespace heft::excite
