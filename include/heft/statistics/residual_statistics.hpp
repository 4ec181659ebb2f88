/// @file
/// How the measured torque misses a model: what an estimator that works on the model must reckon with.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/statistics/correlation.hpp"

namespace heft::statistics {

/// Scatter of measured minus modelled torque behind the causal low-pass, over samples in which the joint
/// moves.
struct ResidualStatistics {
  Eigen::VectorXd std;               ///< per joint [N·m, N]
  Eigen::VectorXd correlation_time;  ///< per joint: see correlation.hpp [s]
  double cutoff{0.0};                ///< of the low-pass [Hz]

  /// Samples of this period that hold as much information as one, in the joint where they are most; ≥ 1.
  double correlated_samples(double period) const;
  /// Length of blocks whose sums may count as independent of one another: three times the longest
  /// correlation time, at least 1 s and at most a tenth of `duration` (else too few blocks would be left)
  /// [s].
  double block_length(double duration) const;
  /// What the variance from blocks of this length must be multiplied by, because neighbours are correlated
  /// at their edges: 1 / (1 − c/2L) for an exponential autocorrelation of correlation time c and blocks of
  /// length L.
  double edge_factor(double block) const;
};

}  // namespace heft::statistics
