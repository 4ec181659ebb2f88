/// @file
/// Signals averaged over bins of another one, for a curve through many points.
#pragma once

#include <Eigen/Core>

namespace heft::statistics {

/// Means of signals over bins of x, from 240 equal ones; bins that hold little are merged with their
/// neighbours.
struct BinnedMeans {
  Eigen::VectorXd x;      ///< mean x of a bin, b
  Eigen::MatrixXd means;  ///< b × columns
};
/// @param values  one row for each entry of x
/// @return empty when x is empty or constant
BinnedMeans binned_means(const Eigen::VectorXd& x, const Eigen::MatrixXd& values);

}  // namespace heft::statistics
