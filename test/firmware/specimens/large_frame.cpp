// Must be turned away by the stack gate: a recursive least-squares step of seven rows and seventy parameters in
// plain Eigen products, whose temporaries make a frame of 60 KB.
#include <Eigen/Core>
#include <Eigen/LU>

using Covariance = Eigen::Matrix<double, 70, 70>;
using Rows = Eigen::Matrix<double, 7, 70>;
using Weight = Eigen::Matrix<double, 7, 7>;

void update(Covariance& covariance, const Rows& rows) {
  const Rows projected = rows * covariance;
  const Weight weight = Weight::Identity() + projected * rows.transpose();
  covariance -= projected.transpose() * (weight.inverse() * projected);
}
