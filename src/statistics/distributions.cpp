#include "heft/statistics/distributions.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <unsupported/Eigen/SpecialFunctions>

namespace heft::statistics {

double interval_factor(int degrees_of_freedom) {
  if (degrees_of_freedom < 1) return std::numeric_limits<double>::infinity();
  // Exact for one and two degrees of freedom; from three on the expansion in 1/ν about the normal quantile
  // (Abramowitz and Stegun 26.7.5), off by less than 0.3 % at three and 0.02 % from five on.
  if (degrees_of_freedom == 1) return 12.7062;
  if (degrees_of_freedom == 2) return 4.30265;
  constexpr double z = 1.959963984540054;
  const double nu = degrees_of_freedom;
  const double z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z, z9 = z7 * z * z;
  return z + (z3 + z) / (4 * nu) + (5 * z5 + 16 * z3 + 3 * z) / (96 * nu * nu) +
         (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * nu * nu * nu) +
         (79 * z9 + 776 * z7 + 1482 * z5 - 1920 * z3 - 945 * z) / (92160 * nu * nu * nu * nu);
}

int degrees_of_freedom(double factor) {
  constexpr int kNearlyNormal = 1000;
  if (!(factor > interval_factor(kNearlyNormal))) return kNearlyNormal;
  int low = 1, high = kNearlyNormal;  // the factor falls with the degrees of freedom
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (interval_factor(middle) > factor ? low : high) = middle;
  }
  return factor - interval_factor(high) < interval_factor(low) - factor ? high : low;
}

double student_two_sided(double value, double degrees_of_freedom) {
  return fisher_tail(value * value, 1.0, degrees_of_freedom);  // t² follows F(1, ν)
}

double student_quantile(double probability, double degrees_of_freedom) {
  double low = 0.0, high = 1.0;
  while (student_two_sided(high, degrees_of_freedom) > probability && high < 1e12) high *= 2.0;
  while (high - low > 1e-9 * high) {
    const double middle = 0.5 * (low + high);
    (student_two_sided(middle, degrees_of_freedom) > probability ? low : high) = middle;
  }
  return high;
}

double fisher_tail(double value, double numerator, double denominator) {
  if (!(value > 0.0)) return 1.0;
  // P(F > f) = I_x(d₂/2, d₁/2), x = d₂/(d₂ + d₁ f).
  const auto one = [](double v) { return Eigen::Array<double, 1, 1>::Constant(v); };
  return Eigen::betainc(one(0.5 * denominator), one(0.5 * numerator),
                        one(denominator / (denominator + numerator * value)))(0);
}

}  // namespace heft::statistics
