#include "derive_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cutoff.hpp"
#include "heft/host/error.hpp"
#include "resample.hpp"
#include "savitzky_golay.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Weights of the first derivative at `at` of the polynomial through the values at t[0..count).
/// d/dx of each Lagrange polynomial; exact products, no recursion needed for five points.
void derivative_weights(const double* t, int count, double at, double* weights) {
  for (int j = 0; j < count; ++j) {
    double denominator = 1.0;
    double numerator = 0.0;
    for (int k = 0; k < count; ++k) {
      if (k == j) continue;
      denominator *= t[j] - t[k];
      double product = 1.0;
      for (int l = 0; l < count; ++l) {
        if (l != j && l != k) product *= at - t[l];
      }
      numerator += product;
    }
    weights[j] = numerator / denominator;
  }
}

/// Whether times are evenly spaced but for rounding.
bool is_even(const Eigen::VectorXd& time) {
  const Index last = time.size() - 1;
  const double period = (time[last] - time[0]) / static_cast<double>(last);
  const double rounding =
      4.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(time[0]), std::abs(time[last]));
  for (Index k = 0; k <= last; ++k) {
    if (!(std::abs(time[k] - time[0] - static_cast<double>(k) * period) <= rounding)) return false;
  }
  return true;
}

/// differentiate() on an even grid of at least as many rows as the stencil has: the weights are the same in every row.
Eigen::MatrixXd differentiate_evenly(const Eigen::MatrixXd& signal, double sample_rate, int stencil) {
  const Index n = signal.rows();
  Eigen::MatrixXd derivative(n, signal.cols());
  const std::array<double, 5> numbers{0.0, 1.0, 2.0, 3.0, 4.0};
  const Index half = stencil / 2;
  std::array<double, 5> weights{};
  const auto at_end = [&](Index row, Index begin) {
    derivative_weights(numbers.data(), stencil, static_cast<double>(row - begin), weights.data());
    for (Index column = 0; column < signal.cols(); ++column) {
      const double* x = signal.col(column).data() + begin;
      double sum = 0.0;
      for (Index k = 0; k < stencil; ++k)
        sum += weights[static_cast<std::size_t>(k)] * (x[k] - signal(row, column));
      derivative(row, column) = sample_rate * sum;
    }
  };
  for (Index row = 0; row < half; ++row) at_end(row, 0), at_end(n - 1 - row, n - stencil);
  for (Index column = 0; column < signal.cols(); ++column) {
    const double* const x = signal.col(column).data();
    double* const d = derivative.col(column).data();
    // Differences of values at the same distance: a large constant in x leaves no rounding noise.
    if (stencil == 3) {
      for (Index k = 1; k < n - 1; ++k) d[k] = 0.5 * sample_rate * (x[k + 1] - x[k - 1]);
    } else {
      const double scale = sample_rate / 12.0;
      for (Index k = 2; k < n - 2; ++k)
        d[k] = scale * (8.0 * (x[k + 1] - x[k - 1]) - (x[k + 2] - x[k - 2]));
    }
  }
  return derivative;
}

}  // namespace

Eigen::MatrixXd differentiate(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal, int stencil) {
  const Index n = time.size();
  if (n < 2 || signal.rows() != n) {
    throw DataError(fmt::format("differentiating: {} times for {} rows; expected the same number, at least 2",
                                n, signal.rows()));
  }
  if (stencil != 3 && stencil != 5) {
    throw DataError(fmt::format("differentiating: stencil of {} samples; expected 3 or 5", stencil));
  }
  if (n >= stencil && is_even(time)) {
    return differentiate_evenly(signal, static_cast<double>(n - 1) / (time[n - 1] - time[0]), stencil);
  }
  const Index count = std::min<Index>(stencil, n);
  Eigen::MatrixXd derivative(n, signal.cols());
  std::array<double, 5> weights{};
  for (Index row = 0; row < n; ++row) {
    const Index begin = std::clamp<Index>(row - count / 2, 0, n - count);
    derivative_weights(time.data() + begin, static_cast<int>(count), time[row], weights.data());
    for (Index column = 0; column < signal.cols(); ++column) {
      const double* x = signal.col(column).data() + begin;
      // Differences to the middle sample: a large constant in x must not leave rounding noise.
      const double middle = signal(row, column);
      double sum = 0.0;
      for (Index k = 0; k < count; ++k) sum += weights[static_cast<std::size_t>(k)] * (x[k] - middle);
      derivative(row, column) = sum;
    }
  }
  return derivative;
}

void refuse_short_log(const std::string& path, long samples) {
  throw DataError(fmt::format(
      "{}: {} samples; expected at least {} to derive velocity and acceleration; give a longer log", path,
      samples, kLeastSamples));
}

namespace {

bool by_savitzky_golay(const MotionOptions& options, double cutoff) {
  return options.method == DerivativeMethod::kSavitzkyGolay && cutoff > 0.0;
}

/// A derivative by a polynomial of `order`, which goes with the cut-off.
Eigen::MatrixXd polynomial_derivative(const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate, double cutoff, int order, int derivative) {
  return savitzky_golay(q, sample_rate, savitzky_golay_window(cutoff, sample_rate, order), order, derivative);
}

Eigen::MatrixXd smoothed(const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate, double cutoff) {
  return cutoff > 0.0 ? low_pass_zero_phase(q, sample_rate, cutoff) : Eigen::MatrixXd(q);
}

}  // namespace

DerivedMotion derive_on_grid(const Eigen::VectorXd& grid, const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate,
                             double cutoff, const MotionOptions& options) {
  DerivedMotion motion;
  if (by_savitzky_golay(options, cutoff)) {
    check_order(options.polynomial_order, 2);
    motion.q = polynomial_derivative(q, sample_rate, cutoff, options.polynomial_order, 0);
    motion.qd = polynomial_derivative(q, sample_rate, cutoff, options.polynomial_order, 1);
    motion.qdd = polynomial_derivative(q, sample_rate, cutoff, options.polynomial_order, 2);
    return motion;
  }
  motion.q = smoothed(q, sample_rate, cutoff);
  motion.qd = differentiate(grid, motion.q, options.stencil);
  motion.qdd = differentiate(grid, motion.qd, options.stencil);
  return motion;
}

Eigen::MatrixXd velocity_on_grid(const Eigen::VectorXd& grid, const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate, double cutoff,
                                 const MotionOptions& options) {
  if (by_savitzky_golay(options, cutoff)) {
    check_order(options.polynomial_order, 1);
    return polynomial_derivative(q, sample_rate, cutoff, options.polynomial_order, 1);
  }
  return differentiate(grid, smoothed(q, sample_rate, cutoff), options.stencil);
}

Index settling_rows(double sample_rate, double cutoff, const MotionOptions& options) {
  if (options.method == DerivativeMethod::kSavitzkyGolay && cutoff > 0.0) {
    // Half a window is reached; with a whole one the ends of the log have theirs in any piece.
    return savitzky_golay_window(cutoff, sample_rate, options.polynomial_order);
  }
  // What the cut does to a piece decays as exp(-0.38·2π f_c t): to 3e-15 in fourteen periods. The differences
  // reach one stencil further for each derivative.
  const Index differences = 2 * options.stencil;
  return differences + (cutoff > 0.0 ? static_cast<Index>(std::ceil(14.0 * sample_rate / cutoff)) : 0);
}

MotionReport derive_motion(Log& log, const MotionOptions& options) {
  MotionReport report;
  const bool need_velocity = options.from_position || log.qd.cols() == 0;
  const bool need_acceleration = options.from_position || log.qdd.cols() == 0;
  if (!need_velocity && !need_acceleration && !options.smooth_position) return report;
  if (log.num_samples() < kLeastSamples) refuse_short_log(log.path, log.num_samples());

  // 1. An even grid, which is the log's own unless the clock jitters.
  report.resampled = !is_uniform(log.time);
  report.gaps = find_gaps(log.time, kGapFactor);
  const double rate = median_sample_rate(log.time);
  const Eigen::VectorXd grid = report.resampled
                                   ? even_grid(log.time, rate)
                                   : Eigen::VectorXd(Eigen::VectorXd::LinSpaced(
                                         log.time.size(), log.time[0], log.time[log.time.size() - 1]));
  report.sample_rate = static_cast<double>(grid.size() - 1) / (grid[grid.size() - 1] - grid[0]);
  const auto to_grid = [&](const Eigen::MatrixXd& x, Bridge bridge) {
    return report.resampled ? resample(log.time, x, grid, kGapFactor / rate, bridge) : x;
  };
  const auto from_grid = [&](const Eigen::MatrixXd& x) {
    return report.resampled ? resample(grid, x, log.time) : x;
  };

  // 2. The cut-off.
  const Eigen::MatrixXd q = to_grid(log.q, Bridge::kMotion);
  if (options.cutoff == 0.0) {
    report.cutoff_chosen = true;
    report.bandwidth = motion_bandwidth(q, report.sample_rate);
  }
  report.cutoff = choose_cutoff(log.path, options, report.bandwidth, report.sample_rate);

  // 3. Filter, differentiate, back to the log's time stamps.
  if (need_velocity || options.smooth_position) {
    DerivedMotion motion = derive_on_grid(grid, q, report.sample_rate, report.cutoff, options);
    if (need_velocity) {
      log.qd = from_grid(motion.qd);
      report.velocity_derived = true;
      if (need_acceleration) log.qdd = from_grid(motion.qdd);
    }
    if (options.smooth_position) log.q = from_grid(motion.q);
  }
  if (!need_velocity && need_acceleration) {
    log.qdd = from_grid(derive_on_grid(grid, to_grid(log.qd, Bridge::kLine), report.sample_rate, report.cutoff, options).qd);
  }
  report.acceleration_derived = need_acceleration;
  return report;
}

}  // namespace heft::data
