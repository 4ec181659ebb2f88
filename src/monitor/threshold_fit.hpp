/// @file
/// Shape and size of one joint's threshold from deviations of free motion. Derivation: thresholds.md.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "causal_run.hpp"

namespace heft::monitor {

/// Deviations of one joint in one log of the free motion, with their circumstances, judged rows only.
struct Part {
  Eigen::VectorXd size;          ///< |deviation| [N·m, N]
  Eigen::MatrixXd circumstance;  ///< rows × kCircumstances
  std::vector<long> block;       ///< number of the block that a row belongs to, ascending
};

using Shape = Eigen::Matrix<double, kCircumstances, 1>;

/// Linear form that nine tenths of the deviations stay below, roughly: asymmetric least squares (expectile 0.9) without
/// negative coefficients.
Shape fit_shape(const std::vector<Part>& parts);

/// Largest deviation over the shape in each block.
std::vector<double> block_maxima(const std::vector<Part>& parts, const Shape& shape);

/// The tail of block maxima: beyond `from` they fall off exponentially with the mean excess `mean_excess`.
struct Tail {
  double from{0.0}, mean_excess{0.0};
  long beyond{0}, blocks{0};

  /// Multiple of the shape that is exceeded at that rate a block.
  double level(double rate) const;
  /// Logarithm of the rate a block at which that multiple is exceeded, and its standard deviation.
  double log_rate(double level) const;
  double log_rate_std(double level) const;
};
Tail tail_of(std::vector<double> maxima);

}  // namespace heft::monitor
