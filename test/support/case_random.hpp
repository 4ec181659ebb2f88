/// @file
/// Random numbers and smooth steps of simulated cases.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace heft::test {

using Random = std::mt19937_64;

inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
inline double log_uniform(Random& random, double low, double high) {
  return std::exp(uniform(random, std::log(low), std::log(high)));
}
inline double normal(Random& random) { return std::normal_distribution<double>()(random); }
inline bool chance(Random& random, double share) { return uniform(random, 0.0, 1.0) < share; }
inline double either(Random& random) { return chance(random, 0.5) ? 1.0 : -1.0; }
inline int pick(Random& random, int count) { return std::uniform_int_distribution<int>(0, count - 1)(random); }

inline double smooth_step(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
}
/// Integral of smooth_step from 0.
inline double smooth_step_integral(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 0.5 + (u - 1.0);
  return u * u * u * u * (2.5 + u * (-3.0 + u));
}

}  // namespace heft::test
