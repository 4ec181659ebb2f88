#include "heft/data/differentiate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <unsupported/Eigen/FFT>

#include "heft/host/error.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Longest stretch without samples that a spline may bridge, in median periods.
constexpr double kGapFactor = 10.0;

double median_period(const Eigen::VectorXd& time) {
  if (time.size() < 2)
    throw DataError(fmt::format("{} samples; expected at least 2 for a sample rate", time.size()));
  std::vector<double> periods(static_cast<std::size_t>(time.size() - 1));
  for (std::size_t k = 0; k < periods.size(); ++k) {
    periods[k] = time[static_cast<Index>(k) + 1] - time[static_cast<Index>(k)];
  }
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return *middle;
}

/// Second derivatives at the knots of the not-a-knot cubic spline through (t, y), one column a signal.
/// Needs at least four knots; fewer give the parabola or the straight line.
Eigen::MatrixXd spline_curvature(const Eigen::VectorXd& t, const Eigen::MatrixXd& y) {
  const Index n = t.size();
  Eigen::MatrixXd curvature = Eigen::MatrixXd::Zero(n, y.cols());
  if (n < 3) return curvature;
  const Eigen::VectorXd h = t.tail(n - 1) - t.head(n - 1);
  const auto slope = [&](Index k) { return ((y.row(k + 1) - y.row(k)) / h[k]).eval(); };
  if (n == 3) {
    const auto second = (2.0 * (slope(1) - slope(0)) / (h[0] + h[1])).eval();
    for (Index k = 0; k < 3; ++k) curvature.row(k) = second;
    return curvature;
  }
  // Inner equations h[k-1] c[k-1] + 2 (h[k-1]+h[k]) c[k] + h[k] c[k+1] = 6 (slope[k] - slope[k-1]), k = 1..n-2,
  // with not-a-knot ends: c[0] = c[1] - h[0]/h[1] (c[2] - c[1]), likewise at the other end. Putting the ends
  // in leaves a tridiagonal system. Its rows stay diagonally dominant (first row: 3h0 + 2h1 + h0²/h1 against
  // |h1 - h0²/h1|), so elimination needs no pivoting.
  const Index m = n - 2;
  Eigen::VectorXd lower(m), diagonal(m), upper(m);
  Eigen::MatrixXd right(m, y.cols());
  for (Index k = 1; k <= m; ++k) {
    lower[k - 1] = h[k - 1];
    diagonal[k - 1] = 2.0 * (h[k - 1] + h[k]);
    upper[k - 1] = h[k];
    right.row(k - 1) = 6.0 * (slope(k) - slope(k - 1));
  }
  const double first = h[0] / h[1];
  diagonal[0] += h[0] * (1.0 + first);
  upper[0] -= h[0] * first;
  const double last = h[n - 2] / h[n - 3];
  diagonal[m - 1] += h[n - 2] * (1.0 + last);
  lower[m - 1] -= h[n - 2] * last;
  for (Index k = 1; k < m; ++k) {
    const double factor = lower[k] / diagonal[k - 1];
    diagonal[k] -= factor * upper[k - 1];
    right.row(k) -= factor * right.row(k - 1);
  }
  curvature.row(m) = right.row(m - 1) / diagonal[m - 1];
  for (Index k = m - 1; k >= 1; --k) {
    curvature.row(k) = (right.row(k - 1) - upper[k - 1] * curvature.row(k + 1)) / diagonal[k - 1];
  }
  curvature.row(0) = curvature.row(1) - first * (curvature.row(2) - curvature.row(1));
  curvature.row(n - 1) = curvature.row(n - 2) + last * (curvature.row(n - 2) - curvature.row(n - 3));
  return curvature;
}

/// One second-order low-pass section as two trapezoidal integrators.
/// H(s) = 1 / (s² + s/Q + 1) with s = (1/g) (z-1)/(z+1), g = tan(π f_c / f_s).
struct Section {
  double a1, a2, a3;
  double state1{0.0}, state2{0.0};

  Section(double g, double quality) {
    a1 = 1.0 / (1.0 + g * (g + 1.0 / quality));
    a2 = g * a1;
    a3 = g * a2;
  }

  /// State that holds the constant input `value` for ever.
  void rest_at(double value) {
    state1 = 0.0;
    state2 = value;
  }

  double step(double input) {
    const double v3 = input - state2;
    const double v1 = a1 * state1 + a2 * v3;
    const double v2 = state2 + a2 * state1 + a3 * v3;
    state1 = 2.0 * v1 - state1;
    state2 = 2.0 * v2 - state2;
    return v2;
  }
};

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

Eigen::VectorXd even_grid(const Eigen::VectorXd& time, double sample_rate) {
  const double length = time[time.size() - 1] - time[0];
  const Index count = std::max<Index>(2, static_cast<Index>(std::llround(length * sample_rate)) + 1);
  return Eigen::VectorXd::LinSpaced(count, time[0], time[time.size() - 1]);
}

}  // namespace

std::vector<TimeGap> find_gaps(const Eigen::VectorXd& time, double factor) {
  std::vector<TimeGap> gaps;
  if (time.size() < 2) return gaps;
  const double longest = factor * median_period(time);
  for (Index k = 0; k + 1 < time.size(); ++k) {
    if (time[k + 1] - time[k] > longest) gaps.push_back({time[k], time[k + 1]});
  }
  return gaps;
}

double median_sample_rate(const Eigen::VectorXd& time) { return 1.0 / median_period(time); }

bool is_uniform(const Eigen::VectorXd& time) {
  if (time.size() < 3) return true;
  const double period = (time[time.size() - 1] - time[0]) / static_cast<double>(time.size() - 1);
  for (Index k = 0; k < time.size(); ++k) {
    if (std::abs(time[k] - time[0] - static_cast<double>(k) * period) > 0.01 * period) return false;
  }
  return true;
}

Eigen::MatrixXd resample(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal,
                         const Eigen::VectorXd& at) {
  const Index n = time.size();
  if (n == 0 || signal.rows() != n) {
    throw DataError(fmt::format("resampling: {} times for {} rows; expected the same number, at least 1", n,
                                signal.rows()));
  }
  Eigen::MatrixXd result(at.size(), signal.cols());
  if (n == 1) {
    for (Index k = 0; k < at.size(); ++k) result.row(k) = signal.row(0);
    return result;
  }
  // Pieces between gaps have their own spline; in a gap the curvature is zero, which is the straight line.
  const double longest = kGapFactor * median_period(time);
  Eigen::MatrixXd curvature(n, signal.cols());
  for (Index begin = 0; begin < n;) {
    Index end = begin + 1;
    while (end < n && time[end] - time[end - 1] <= longest) ++end;
    curvature.middleRows(begin, end - begin) =
        spline_curvature(time.segment(begin, end - begin), signal.middleRows(begin, end - begin));
    begin = end;
  }
  Index k = 0;
  for (Index row = 0; row < at.size(); ++row) {
    const double t = at[row];
    if (t <= time[0]) {
      result.row(row) = signal.row(0);
      continue;
    }
    if (t >= time[n - 1]) {
      result.row(row) = signal.row(n - 1);
      continue;
    }
    if (t < time[k]) k = 0;  // not increasing after all: start over
    while (time[k + 1] < t) ++k;
    const double h = time[k + 1] - time[k];
    const double right = (t - time[k]) / h;
    const double left = 1.0 - right;
    result.row(row) = left * signal.row(k) + right * signal.row(k + 1);
    if (h <= longest) {
      // Cubic part: ((left³ - left) c[k] + (right³ - right) c[k+1]) h²/6.
      result.row(row) += (h * h / 6.0) * (left * (left * left - 1.0) * curvature.row(k) +
                                          right * (right * right - 1.0) * curvature.row(k + 1));
    }
  }
  return result;
}

Log resample_uniform(const Log& log, double sample_rate) {
  if (log.num_samples() < 2) {
    throw DataError(fmt::format("{}: {} samples; expected at least 2 to resample; give a longer log",
                                log.path, log.num_samples()));
  }
  if (sample_rate == 0.0) sample_rate = median_sample_rate(log.time);
  if (!(sample_rate > 0.0) || !std::isfinite(sample_rate)) {
    throw DataError(fmt::format("{}: sample rate {} Hz; expected a positive number", log.path, sample_rate));
  }
  Log result;
  result.path = log.path;
  result.time = even_grid(log.time, sample_rate);
  for (Eigen::MatrixXd Log::*channel :
       {&Log::q, &Log::qd, &Log::qdd, &Log::tau, &Log::current, &Log::qref, &Log::qdref, &Log::temperature}) {
    if ((log.*channel).cols() > 0) result.*channel = resample(log.time, log.*channel, result.time);
  }
  for (const auto& [name, values] : log.extra) {
    result.extra.emplace_back(name, resample(log.time, values, result.time));
  }
  return result;
}

Eigen::MatrixXd low_pass_zero_phase(const Eigen::MatrixXd& signal, double sample_rate, double cutoff) {
  if (!(cutoff > 0.0 && cutoff < 0.5 * sample_rate)) {
    throw DataError(
        fmt::format("cut-off {:.6g} Hz at a sample rate of {:.6g} Hz; expected more than 0 and less than "
                    "half the rate, {:.6g} Hz; choose another cut-off",
                    cutoff, sample_rate, 0.5 * sample_rate));
  }
  const Index n = signal.rows();
  if (n < 2) return signal;
  // The slowest pole decays as exp(-0.38·2π f_c t): 8e-4 is left of the start-up after three periods.
  const double wanted = std::ceil(3.0 * sample_rate / cutoff);
  const Index pad = wanted < static_cast<double>(n - 1) ? static_cast<Index>(wanted) : n - 1;

  const double g = std::tan(std::numbers::pi * cutoff / sample_rate);
  // Butterworth poles of order 4 at ±22.5° and ±67.5° from the negative real axis: Q = 1/(2 cos θ).
  const std::array<double, 2> quality{1.0 / (2.0 * std::cos(std::numbers::pi / 8.0)),
                                      1.0 / (2.0 * std::cos(3.0 * std::numbers::pi / 8.0))};
  const auto run = [&](Eigen::VectorXd& x, bool backwards) {
    Section first(g, quality[0]);
    Section second(g, quality[1]);
    const Index count = x.size();
    const double start = backwards ? x[count - 1] : x[0];
    first.rest_at(start);
    second.rest_at(start);
    for (Index step = 0; step < count; ++step) {
      double& value = x[backwards ? count - 1 - step : step];
      value = second.step(first.step(value));
    }
  };

  Eigen::MatrixXd result(n, signal.cols());
  Eigen::VectorXd padded(n + 2 * pad);
  for (Index column = 0; column < signal.cols(); ++column) {
    const auto x = signal.col(column);
    for (Index k = 0; k < pad; ++k) {
      padded[k] = 2.0 * x[0] - x[pad - k];
      padded[pad + n + k] = 2.0 * x[n - 1] - x[n - 2 - k];
    }
    padded.segment(pad, n) = x;
    run(padded, false);
    run(padded, true);
    result.col(column) = padded.segment(pad, n);
  }
  return result;
}

Eigen::MatrixXd differentiate(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal, int stencil) {
  const Index n = time.size();
  if (n < 2 || signal.rows() != n) {
    throw DataError(fmt::format("differentiating: {} times for {} rows; expected the same number, at least 2",
                                n, signal.rows()));
  }
  if (stencil != 3 && stencil != 5) {
    throw DataError(fmt::format("differentiating: stencil of {} samples; expected 3 or 5", stencil));
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

double motion_bandwidth(const Eigen::MatrixXd& q_uniform, double sample_rate) {
  constexpr double kRestingDeviation = 5e-3;
  const Index n = q_uniform.rows();
  if (n < 8 || q_uniform.cols() == 0) return 0.0;
  const Eigen::RowVectorXd mean = q_uniform.colwise().mean();
  const Eigen::RowVectorXd deviation =
      ((q_uniform.rowwise() - mean).colwise().squaredNorm() / static_cast<double>(n)).cwiseSqrt();
  const double least = std::max(kRestingDeviation, 0.01 * deviation.maxCoeff());

  Index length = 16;
  while (length < n) length *= 2;  // a power of two keeps the transform fast for any log length
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<double> windowed(static_cast<std::size_t>(length));
  std::vector<std::complex<double>> spectrum;
  double bandwidth = 0.0;
  for (Index joint = 0; joint < q_uniform.cols(); ++joint) {
    if (deviation[joint] < least) continue;
    for (Index k = 0; k < n; ++k) {
      const double turn = (static_cast<double>(k) + 0.5) / static_cast<double>(n);
      windowed[static_cast<std::size_t>(k)] =
          (0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * turn)) * (q_uniform(k, joint) - mean[joint]);
    }
    fft.fwd(spectrum, windowed);
    double total = 0.0;
    for (const std::complex<double>& line : spectrum) total += std::norm(line);
    double sum = 0.0;
    for (std::size_t k = 0; k < spectrum.size(); ++k) {
      sum += std::norm(spectrum[k]);
      if (sum >= 0.9999 * total) {
        bandwidth = std::max(bandwidth, static_cast<double>(k) * sample_rate / static_cast<double>(length));
        break;
      }
    }
  }
  return bandwidth;
}

MotionReport derive_motion(Log& log, const MotionOptions& options) {
  MotionReport report;
  const bool need_velocity = options.from_position || log.qd.cols() == 0;
  const bool need_acceleration = options.from_position || log.qdd.cols() == 0;
  if (!need_velocity && !need_acceleration && !options.smooth_position) return report;
  if (log.num_samples() < 5) {
    throw DataError(fmt::format(
        "{}: {} samples; expected at least 5 to derive velocity and acceleration; give a longer log",
        log.path, log.num_samples()));
  }

  // 1. An even grid, which is the log's own unless the clock jitters.
  report.resampled = !is_uniform(log.time);
  report.gaps = find_gaps(log.time, kGapFactor);
  const double rate = median_sample_rate(log.time);
  const Eigen::VectorXd grid = report.resampled
                                   ? even_grid(log.time, rate)
                                   : Eigen::VectorXd(Eigen::VectorXd::LinSpaced(
                                         log.time.size(), log.time[0], log.time[log.time.size() - 1]));
  report.sample_rate = static_cast<double>(grid.size() - 1) / (grid[grid.size() - 1] - grid[0]);
  const auto to_grid = [&](const Eigen::MatrixXd& x) {
    return report.resampled ? resample(log.time, x, grid) : x;
  };
  const auto from_grid = [&](const Eigen::MatrixXd& x) {
    return report.resampled ? resample(grid, x, log.time) : x;
  };

  // 2. The cut-off.
  Eigen::MatrixXd q = to_grid(log.q);
  report.cutoff = options.cutoff;
  if (options.cutoff == 0.0) {
    report.cutoff_chosen = true;
    report.bandwidth = motion_bandwidth(q, report.sample_rate);
    const double most = 0.4 * report.sample_rate;
    if (report.bandwidth == 0.0) {
      report.cutoff = std::min(10.0, most);
    } else {
      report.cutoff = std::max(3.0, 10.0 * report.bandwidth);
      if (report.cutoff > most) report.cutoff = 0.0;
    }
  } else if (!(options.cutoff > 0.0 && options.cutoff < 0.5 * report.sample_rate)) {
    throw DataError(fmt::format(
        "{}: cut-off {:.6g} Hz; the log has {:.6g} samples a second; expected more than 0 and less "
        "than {:.6g} Hz; choose a lower cut-off",
        log.path, options.cutoff, report.sample_rate, 0.5 * report.sample_rate));
  }
  const auto low_pass = [&](const Eigen::MatrixXd& x) {
    return report.cutoff > 0.0 ? low_pass_zero_phase(x, report.sample_rate, report.cutoff) : x;
  };

  // 3. Filter, differentiate, back to the log's time stamps.
  Eigen::MatrixXd qd;
  if (need_velocity || options.smooth_position) q = low_pass(q);
  if (need_velocity) {
    qd = differentiate(grid, q, options.stencil);
    report.velocity_derived = true;
  } else if (need_acceleration) {
    qd = low_pass(to_grid(log.qd));
  }
  if (need_acceleration) {
    log.qdd = from_grid(differentiate(grid, qd, options.stencil));
    report.acceleration_derived = true;
  }
  if (need_velocity) log.qd = from_grid(qd);
  if (options.smooth_position) log.q = from_grid(q);
  return report;
}

}  // namespace heft::data
