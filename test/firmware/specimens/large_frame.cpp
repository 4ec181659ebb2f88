// Must be turned away by the stack gate: a covariance of seventy parameters made symmetric the obvious way, whose
// temporary makes a frame of 39 KB. (Whole products do so as well, and take half a minute to compile.)
#include <Eigen/Core>

using Covariance = Eigen::Matrix<double, 70, 70>;

void symmetrise(Covariance& covariance) { covariance = (0.5 * (covariance + covariance.transpose())).eval(); }
