/// @file
/// How long a residual remembers: the time that holds as much information as one independent sample.
#pragma once

#include <Eigen/Core>

namespace heft::statistics {

/// Samples that hold as much information as one independent sample, 1 + 2 Σ ρ(k), summed up to the first ρ
/// that is not above 0.05.
/// @param rho   autocorrelation at a lag [samples]; called with 1, 2, ...
/// @param lags  the sum ends before this one
template <typename Autocorrelation>
double correlated_samples(const Autocorrelation& rho, Eigen::Index lags) {
  constexpr double kUncorrelated = 0.05;  // beyond, an estimate of ρ is noise, and its sum would wander
  double sum = 1.0;
  for (Eigen::Index lag = 1; lag < lags; ++lag) {
    const double r = rho(lag);
    if (!(r > kUncorrelated)) break;
    sum += 2.0 * r;
  }
  return sum;
}

/// The same as a time, T (1 + 2 Σ ρ(k)), of one signal about zero: a constant error counts as correlated for ever.
/// @param residual  one column of samples; NaN where there is none
/// @param period    mean time between samples T [s]
/// @return [s]; `period` for fewer than 10 samples or none
double correlation_time(const Eigen::VectorXd& residual, double period);

}  // namespace heft::statistics
