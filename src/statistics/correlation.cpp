#include "heft/statistics/correlation.hpp"

#include <cmath>

namespace heft::statistics {

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
  const auto rho = [&](Eigen::Index lag) {
    return e.head(e.size() - lag).dot(e.tail(e.size() - lag)) / squares;
  };
  return correlated_samples(rho, e.size() / 4) * period;
}

}  // namespace heft::statistics
