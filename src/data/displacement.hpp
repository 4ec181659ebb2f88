/// @file
/// Displacements of joints from row to row, from the logged velocity and the logged position together.
#pragma once

#include <Eigen/Core>

namespace heft::data {

/// Standard deviation of each logged position while its joint rests, from steps between neighbouring rows.
class PositionNoise {
 public:
  explicit PositionNoise(Eigen::Index joints)
      : squares_(Eigen::RowVectorXd::Zero(joints)), rows_(Eigen::RowVectorXd::Zero(joints)) {}
  /// Neighbouring rows, rows × n each.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q, const Eigen::Ref<const Eigen::MatrixXd>& qd);
  /// [rad, m]; 0 for a joint that never rests.
  Eigen::RowVectorXd value() const;

 private:
  Eigen::RowVectorXd squares_, rows_;
};

/// Integral of the logged velocity from the first row on (n columns), then the same held within four standard
/// deviations of the logged position (n columns).
/// @param noise  standard deviation of each position [rad, m]
Eigen::MatrixXd travelled(const Eigen::VectorXd& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
                          const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::RowVectorXd& noise);

/// A path as `travelled` gives it, read at the rows of a grid. Friction's memory goes by turning points: one that lies
/// between rows of the grid moves to the nearest of them.
Eigen::MatrixXd on_even_rows(const Eigen::VectorXd& grid, double sample_rate, const Eigen::VectorXd& time,
                             const Eigen::MatrixXd& path);

/// Differences to the row before of rows first .. first + rows; 0 in row 0, which nothing precedes.
Eigen::MatrixXd steps(const Eigen::MatrixXd& x, Eigen::Index first, Eigen::Index rows);

}  // namespace heft::data
