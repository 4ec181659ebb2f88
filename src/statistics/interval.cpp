#include "heft/statistics/interval.hpp"

#include <cmath>

#include <unsupported/Eigen/SpecialFunctions>

namespace heft::statistics {

Interval reciprocal(const Interval& x) {
  Interval turned{kInfinity, kNaN, 0.0, kInfinity};
  if (x.value > 0.0) {
    turned.value = 1.0 / x.value;
    turned.std = x.std / (x.value * x.value);
  }
  if (x.upper > 0.0) turned.lower = 1.0 / x.upper;
  if (x.lower > 0.0) turned.upper = 1.0 / x.lower;
  return turned;
}

namespace {

/// Value of a gamma distribution of that shape that a share of it lies below.
double gamma_quantile(double shape, double share) {
  const auto one = [](double v) { return Eigen::Array<double, 1, 1>::Constant(v); };
  double low = 0.0, high = shape + 20.0 * std::sqrt(shape) + 20.0;
  for (int step = 0; step < 100; ++step) {
    const double middle = 0.5 * (low + high);
    (Eigen::igamma(one(shape), one(middle))(0) < share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

Interval count_interval(long count) {
  const double k = static_cast<double>(count);
  return {k, std::sqrt(k), count > 0 ? gamma_quantile(k, 0.025) : 0.0, gamma_quantile(k + 1.0, 0.975)};
}

}  // namespace heft::statistics
