/// @file
/// Regressor and torque along a motion with exact derivatives by positions, velocities and accelerations.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/regression_columns.hpp"

namespace heft::excite {

/// Chosen columns of the regression, smooth sign, and the torque without Coulomb friction.
///
/// A link's columns are zero in the rows of joints beyond it. Columns are therefore sorted by the last joint that feels them, and
/// a row is kept from the first column on that it can feel.
class DifferentiableRegressor {
 public:
  virtual ~DifferentiableRegressor() = default;

  /// Chosen column that is at each place in the order of the rows.
  const std::vector<int>& order() const { return order_; }
  /// Place of the first column that the row of a joint can feel.
  Eigen::Index first(Eigen::Index joint) const { return first_[static_cast<std::size_t>(joint)]; }

  /// @param q,qd,qdd  m × n
  /// @param rows      out, n matrices of m rows, each with the columns from first() on
  /// @param tau       out, m × n: rigid bodies, rotors, viscous friction and offset [N·m, N]
  virtual void evaluate(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                        std::vector<Eigen::MatrixXd>& rows, Eigen::MatrixXd& tau) const = 0;

  /// Adds the derivatives of Σ G · rows + Σ h · tau, m × n each.
  /// @param G  as rows
  /// @param h  m × n
  virtual void add_gradient(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                            const std::vector<Eigen::MatrixXd>& G, const Eigen::MatrixXd& h,
                            Eigen::MatrixXd& by_q, Eigen::MatrixXd& by_qd, Eigen::MatrixXd& by_qdd) const = 0;

 protected:
  std::vector<int> order_;
  std::vector<Eigen::Index> first_;
};

/// @param chosen      columns wanted
/// @param sign_width  n: tanh(q̇/width) replaces the sign [rad/s, m/s]
std::unique_ptr<DifferentiableRegressor> make_differentiable_regressor(
    const regression::RegressionColumns& columns, const std::vector<int>& chosen,
    const Eigen::VectorXd& sign_width);

}  // namespace heft::excite
