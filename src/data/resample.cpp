#include "resample.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/QR>
#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

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
  // Inner equations h[k-1] c[k-1] + 2 (h[k-1]+h[k]) c[k] + h[k] c[k+1] = 6 (slope[k] - slope[k-1]), k =
  // 1..n-2, with not-a-knot ends: c[0] = c[1] - h[0]/h[1] (c[2] - c[1]), likewise at the other end. Putting
  // the ends in leaves a tridiagonal system. Its rows stay diagonally dominant (first row: 3h0 + 2h1 + h0²/h1
  // against |h1 - h0²/h1|), so elimination needs no pivoting.
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

/// Velocity at the sample before a gap, or behind one, by a parabola through those beside it, against noise of single ones.
/// @param longest  step in time that is no gap [s]
Eigen::RowVectorXd velocity_at(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal, Index at, double longest) {
  constexpr double kReach = 0.05;  // [s] at least
  const double reach = std::max(kReach, longest);
  Index from = at, to = at + 1;
  while (from > 0 && time[from] - time[from - 1] <= longest && time[at] - time[from - 1] <= reach) --from;
  while (to < time.size() && time[to] - time[to - 1] <= longest && time[to] - time[at] <= reach) ++to;
  const Index n = to - from, degree = std::min<Index>(2, n - 1);
  if (degree == 0) return Eigen::RowVectorXd::Zero(signal.cols());
  const double length = time[to - 1] - time[from];
  Eigen::MatrixXd powers(n, degree + 1);
  for (Index k = 0; k < n; ++k) {
    for (Index p = 0; p <= degree; ++p) powers(k, p) = std::pow((time[from + k] - time[at]) / length, static_cast<double>(p));
  }
  const Eigen::MatrixXd off = signal.middleRows(from, n).rowwise() - signal.row(at);
  return powers.householderQr().solve(off).row(1) / length;
}

}  // namespace

Index grid_rows(double length, double sample_rate) {
  return std::max<Index>(2, static_cast<Index>(std::llround(length * sample_rate)) + 1);
}

Eigen::VectorXd even_grid(const Eigen::VectorXd& time, double sample_rate) {
  const double begin = time[0];
  const double end = time[time.size() - 1];
  return Eigen::VectorXd::LinSpaced(grid_rows(end - begin, sample_rate), begin, end);
}

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
  return resample(time, signal, at, time.size() < 2 ? 0.0 : kGapFactor * median_period(time));
}

Eigen::MatrixXd resample(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal,
                         const Eigen::VectorXd& at, double longest, Bridge bridge) {
  const Index n = time.size();
  if (n == 0 || signal.rows() != n) {
    throw DataError(fmt::format("resampling: {} times for {} rows; expected the same number, at least 1", n,
                                signal.rows()));
  }
  Eigen::MatrixXd result(at.size(), signal.cols());
  if (signal.cols() == 0) return result;  // an empty matrix has no rows to point at
  if (n == 1) {
    for (Index k = 0; k < at.size(); ++k) result.row(k) = signal.row(0);
    return result;
  }
  // Pieces between gaps have their own spline; in a gap the curvature is zero, which is the straight line.
  Eigen::MatrixXd curvature(n, signal.cols());
  for (Index begin = 0; begin < n;) {
    Index end = begin + 1;
    while (end < n && time[end] - time[end - 1] <= longest) ++end;
    curvature.middleRows(begin, end - begin) =
        spline_curvature(time.segment(begin, end - begin), signal.middleRows(begin, end - begin));
    begin = end;
  }
  Index k = 0, bridged = -1;
  Eigen::RowVectorXd before, behind;  // velocities at the gap after sample `bridged`
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
    } else if (bridge == Bridge::kMotion) {
      // Hermite's cubic, off the line by left right (left (v₀ h - Δ) - right (v₁ h - Δ)).
      if (bridged != k) {
        before = velocity_at(time, signal, k, longest);
        behind = velocity_at(time, signal, k + 1, longest);
        bridged = k;
      }
      const Eigen::RowVectorXd way = signal.row(k + 1) - signal.row(k);
      result.row(row) += left * right * (left * (h * before - way) - right * (h * behind - way));
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
  const double longest = kGapFactor / median_sample_rate(log.time);
  for (Eigen::MatrixXd Log::*channel :
       {&Log::q, &Log::qd, &Log::qdd, &Log::tau, &Log::current, &Log::qref, &Log::qdref, &Log::temperature}) {
    if ((log.*channel).cols() == 0) continue;
    result.*channel = resample(log.time, log.*channel, result.time, longest,
                               channel == &Log::q ? Bridge::kMotion : Bridge::kLine);
  }
  for (const auto& [name, values] : log.extra) {
    result.extra.emplace_back(name, resample(log.time, values, result.time));
  }
  return result;
}

}  // namespace heft::data
