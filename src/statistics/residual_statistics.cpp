#include "heft/statistics/residual_statistics.hpp"

#include <algorithm>

namespace heft::statistics {

double ResidualStatistics::correlated_samples(double period) const {
  return correlation_time.size() == 0 || !(period > 0) ? 1.0
                                                       : std::max(1.0, correlation_time.maxCoeff() / period);
}

double ResidualStatistics::block_length(double duration) const {
  const double wanted = correlation_time.size() == 0 ? 1.0 : std::max(1.0, 3.0 * correlation_time.maxCoeff());
  return std::max(1.0, std::min(wanted, 0.1 * duration));
}

double ResidualStatistics::edge_factor(double block) const {
  // The variance of a sum over a length L of noise exp(-2|t|/c) is L c (1 − c/2L) for L well above c.
  const double longest = correlation_time.size() == 0 ? 0.0 : correlation_time.maxCoeff();
  return 1.0 / (1.0 - std::min(0.5, 0.5 * longest / block));
}

}  // namespace heft::statistics
