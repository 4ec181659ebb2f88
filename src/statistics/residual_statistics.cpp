#include "heft/statistics/residual_statistics.hpp"

#include <algorithm>
#include <cmath>

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

double correlation_time(const Eigen::VectorXd& residual, double period) {
  Eigen::VectorXd e = residual;
  Eigen::Index count = 0;
  double squares = 0.0;
  for (double& value : e) {
    if (!std::isfinite(value)) {
      value = 0.0;
      continue;
    }
    squares += value * value;
    ++count;
  }
  if (count < 10 || !(squares > 0)) return period;
  double sum = 1.0;
  // About zero, not about the mean: a constant error is correlated for ever, and must count as such.
  for (Eigen::Index lag = 1; lag < e.size() / 4; ++lag) {
    const double rho = e.head(e.size() - lag).dot(e.tail(e.size() - lag)) / squares;
    if (rho < 0.05) break;
    sum += 2.0 * rho;
  }
  return sum * period;
}

}  // namespace heft::statistics
