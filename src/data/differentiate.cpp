#include "heft/data/differentiate.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/statistics/spectrum.hpp"
#include "motion_steps.hpp"

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
  const double begin = time[0];
  const double end = time[time.size() - 1];
  return Eigen::VectorXd::LinSpaced(grid_rows(end - begin, sample_rate), begin, end);
}

/// Joints whose rms deviation from their mean is less than this rest for certain [rad, m].
constexpr double kRestingDeviation = 5e-3;

/// Number of the spectral line below and at which lies all but 1e-4 of the power.
Index last_line(const Eigen::Ref<const Eigen::VectorXd>& power) {
  const double total = power.sum();
  double sum = 0.0;
  for (Index k = 0; k < power.size(); ++k) {
    sum += power[k];
    if (sum >= 0.9999 * total) return k;
  }
  return 0;
}

}  // namespace

Index grid_rows(double length, double sample_rate) {
  return std::max<Index>(2, static_cast<Index>(std::llround(length * sample_rate)) + 1);
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
                         const Eigen::VectorXd& at, double longest) {
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

namespace {

constexpr int kHighestOrder = 8;

/// Least-squares polynomials over `count` samples at x = -1 .. 1.
class PolynomialFit {
 public:
  PolynomialFit(Index count, int order) : order_(std::min<Index>(order, count - 1)) {
    half_ = 0.5 * static_cast<double>(count - 1);
    Eigen::MatrixXd vandermonde(count, order_ + 1);
    for (Index k = 0; k < count; ++k) {
      double power = 1.0;
      for (Index j = 0; j <= order_; ++j, power *= place(k)) vandermonde(k, j) = power;
    }
    const Qr qr = qr_of(vandermonde);
    // V = QR: the coefficients are R⁻¹ Qᵀ y.
    inverse_ = least_squares(qr.R, qr.Q.transpose());
  }

  /// Place of sample k.
  double place(Index k) const { return half_ > 0.0 ? (static_cast<double>(k) - half_) / half_ : 0.0; }

  /// Coefficients of 1, x, x², ... of each column.
  Eigen::MatrixXd coefficients(const Eigen::Ref<const Eigen::MatrixXd>& y) const { return inverse_ * y; }

  /// What the coefficients are weighted with for the derivative at sample k, in samples^-derivative.
  Eigen::VectorXd at(Index k, int derivative) const {
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(order_ + 1);
    // dˢ/dxˢ xʲ = j (j-1) .. (j-s+1) xʲ⁻ˢ
    double power = 1.0;
    for (Index j = derivative; j <= order_; ++j, power *= place(k)) {
      double factor = 1.0;
      for (int s = 0; s < derivative; ++s) factor *= static_cast<double>(j - s) / half_;
      weights[j] = factor * power;
    }
    return weights;
  }

  /// Weights of the samples for the derivative at sample k.
  Eigen::VectorXd weights(Index k, int derivative) const { return inverse_.transpose() * at(k, derivative); }

 private:
  Index order_;
  double half_{0.0};
  Eigen::MatrixXd inverse_;  ///< (order + 1) × count
};

void check_order(int order, int least) {
  if (order < least || order > kHighestOrder) {
    throw DataError(
        fmt::format("Savitzky-Golay: polynomial order {}; expected {} to {}", order, least, kHighestOrder));
  }
}

}  // namespace

Eigen::MatrixXd savitzky_golay(const Eigen::MatrixXd& signal, double sample_rate, int window, int order,
                               int derivative) {
  if (derivative < 0 || derivative > 2) {
    throw DataError(fmt::format("Savitzky-Golay: derivative {}; expected 0, 1 or 2", derivative));
  }
  check_order(order, derivative);
  if (window <= order || window % 2 == 0) {
    throw DataError(fmt::format(
        "Savitzky-Golay: window of {} samples for order {}; expected an odd number above the order", window,
        order));
  }
  const Index n = signal.rows();
  const double scale = std::pow(sample_rate, derivative);
  Eigen::MatrixXd result(n, signal.cols());
  if (n == 0) return result;

  // The ends, or everything when the window is longer than the record. Differences to one sample: a large
  // constant must not leave rounding noise.
  const Index count = std::min<Index>(window, n);
  const Index half = (count == window) ? window / 2 : n;
  const PolynomialFit fit(count, order);
  const auto read = [&](Index begin, Index from, Index to) {
    const Eigen::RowVectorXd base = signal.row(begin + count / 2);
    const Eigen::MatrixXd polynomial = fit.coefficients(signal.middleRows(begin, count).rowwise() - base);
    for (Index row = from; row < to; ++row) {
      result.row(row) = scale * fit.at(row - begin, derivative).transpose() * polynomial;
      if (derivative == 0) result.row(row) += base;
    }
  };
  read(0, 0, std::min(half, n));
  if (count < window) return result;
  read(n - count, n - half, n);

  const Eigen::VectorXd weights = scale * fit.weights(half, derivative);
  for (Index column = 0; column < signal.cols(); ++column) {
    const auto x = signal.col(column);
    for (Index row = half; row < n - half; ++row) {
      const double middle = x[row];
      result(row, column) = ((x.segment(row - half, window).array() - middle) * weights.array()).sum() +
                            (derivative == 0 ? middle : 0.0);
    }
  }
  return result;
}

int savitzky_golay_window(double cutoff, double sample_rate, int order) {
  check_order(order, 0);
  if (!(cutoff > 0.0 && cutoff < 0.5 * sample_rate)) {
    throw DataError(
        fmt::format("cut-off {:.6g} Hz at a sample rate of {:.6g} Hz; expected more than 0 and less than "
                    "half the rate, {:.6g} Hz; choose another cut-off",
                    cutoff, sample_rate, 0.5 * sample_rate));
  }
  // Gain of a symmetric window at the cut-off: Σ w_k cos(2π k f_c / f_s).
  const auto gain = [&](Index half) {
    const Eigen::VectorXd weights = PolynomialFit(2 * half + 1, order).weights(half, 0);
    double sum = 0.0;
    for (Index k = -half; k <= half; ++k) {
      sum += weights[half + k] *
             std::cos(2.0 * std::numbers::pi * static_cast<double>(k) * cutoff / sample_rate);
    }
    return sum;
  };
  // The gain falls from one to below a half once; what side lobes follow stay below.
  Index low = order / 2;  // as many samples as coefficients: everything passes
  Index high = std::max<Index>(1, 2 * low);
  while (gain(high) > 0.5) {
    low = high;
    high *= 2;
  }
  while (high - low > 1) {
    const Index middle = (low + high) / 2;
    (gain(middle) > 0.5 ? low : high) = middle;
  }
  return static_cast<int>(2 * high + 1);
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
  const Index n = q_uniform.rows();
  if (n < 8 || q_uniform.cols() == 0) return 0.0;
  const Eigen::RowVectorXd mean = q_uniform.colwise().mean();
  const Eigen::RowVectorXd deviation =
      ((q_uniform.rowwise() - mean).colwise().squaredNorm() / static_cast<double>(n)).cwiseSqrt();
  const double least = std::max(kRestingDeviation, 0.01 * deviation.maxCoeff());

  Index length = 16;
  while (length < n) length *= 2;  // a power of two keeps the transform fast for any log length
  statistics::Periodogram periodogram(length);
  Eigen::VectorXd power;
  Index line = 0;
  for (Index joint = 0; joint < q_uniform.cols(); ++joint) {
    if (deviation[joint] < least) continue;
    const std::vector<std::complex<double>>& spectrum = periodogram.of(q_uniform.col(joint), mean[joint]);
    power.resize(static_cast<Index>(spectrum.size()));
    for (std::size_t k = 0; k < spectrum.size(); ++k) power[static_cast<Index>(k)] = std::norm(spectrum[k]);
    line = std::max(line, last_line(power));
  }
  return static_cast<double>(line) * sample_rate / static_cast<double>(length);
}

BandwidthEstimate::BandwidthEstimate(Index rows, Eigen::RowVectorXd mean, double sample_rate)
    : mean_(std::move(mean)), sample_rate_(sample_rate) {
  const Index joints = mean_.size();
  stretch_.resize(std::min(rows, kWhole), joints);
  square_sum_ = Eigen::RowVectorXd::Zero(joints);
  if (rows > kWhole) power_ = Eigen::MatrixXd::Zero(kWhole / 2 + 1, joints);
}

void BandwidthEstimate::add(const Eigen::Ref<const Eigen::MatrixXd>& q) {
  for (Index used = 0; used < q.rows();) {
    if (filled_ == stretch_.rows()) {
      add_stretch();
      // The next stretch begins in the middle of this one.
      const Index kept = filled_ / 2;
      stretch_.topRows(kept) = stretch_.middleRows(filled_ - kept, kept).eval();
      filled_ = kept;
    }
    const Index count = std::min(q.rows() - used, stretch_.rows() - filled_);
    stretch_.middleRows(filled_, count) = q.middleRows(used, count);
    square_sum_ += (q.middleRows(used, count).rowwise() - mean_).colwise().squaredNorm();
    filled_ += count;
    fresh_ += count;
    total_rows_ += count;
    used += count;
  }
}

void BandwidthEstimate::add_stretch() {
  fresh_ = 0;
  if (power_.size() == 0) return;
  statistics::Periodogram periodogram(kWhole);
  for (Index joint = 0; joint < mean_.size(); ++joint) {
    const std::vector<std::complex<double>>& spectrum =
        periodogram.of(stretch_.col(joint).head(filled_), mean_[joint]);
    for (Index k = 0; k < power_.rows(); ++k) {
      power_(k, joint) += std::norm(spectrum[static_cast<std::size_t>(k)]);
    }
  }
}

double BandwidthEstimate::value() {
  if (power_.size() == 0) return motion_bandwidth(stretch_.topRows(filled_), sample_rate_);
  if (fresh_ > 0) add_stretch();
  const Eigen::RowVectorXd deviation = (square_sum_ / static_cast<double>(total_rows_)).cwiseSqrt();
  const double least = std::max(kRestingDeviation, 0.01 * deviation.maxCoeff());
  Index line = 0;
  for (Index joint = 0; joint < mean_.size(); ++joint) {
    if (deviation[joint] >= least) line = std::max(line, last_line(power_.col(joint)));
  }
  return static_cast<double>(line) * sample_rate_ / static_cast<double>(kWhole);
}

void StreamingMedian::add(double value) {
  if (first_pass_) ++total_;
  if (counts_.empty()) {
    if (known_bits_ > 0 && (std::bit_cast<std::uint64_t>(value) >> (64 - known_bits_)) != known_) return;
    values_.push_back(value);
    if (values_.size() <= kMost) return;
    // Too many to keep (only in the first pass): count them instead.
    counts_.assign(std::size_t{1} << kBits, 0);
    for (const double kept : values_) count(kept);
    values_ = {};
    return;
  }
  count(value);
}

void StreamingMedian::count(double value) {
  // Positive numbers are in the order of their binary form.
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
  if (known_bits_ > 0 && (bits >> (64 - known_bits_)) != known_) return;
  ++counts_[(bits >> (64 - kBits - known_bits_)) & ((std::uint64_t{1} << kBits) - 1)];
}

bool StreamingMedian::finish_pass() {
  if (first_pass_) rank_ = total_ / 2;
  first_pass_ = false;
  if (counts_.empty()) {
    if (values_.empty()) return true;
    const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(rank_);
    std::nth_element(values_.begin(), middle, values_.end());
    value_ = *middle;
    return true;
  }
  std::uint64_t digit = 0;
  while (rank_ >= counts_[digit]) rank_ -= counts_[digit++];
  const std::uint64_t in_range = counts_[digit];
  known_ = (known_ << kBits) | digit;
  known_bits_ += kBits;
  if (known_bits_ == 64) {
    value_ = std::bit_cast<double>(known_);
    return true;
  }
  if (in_range <= kMost) {
    counts_ = {};
  } else {
    std::fill(counts_.begin(), counts_.end(), 0);
  }
  return false;
}

double choose_cutoff(const std::string& path, const MotionOptions& options, double bandwidth,
                     double sample_rate) {
  if (options.cutoff == 0.0) {
    const double most = 0.4 * sample_rate;
    if (bandwidth == 0.0) return std::min(10.0, most);
    const double cutoff = std::max(3.0, 10.0 * bandwidth);
    return cutoff > most ? 0.0 : cutoff;
  }
  if (!(options.cutoff > 0.0 && options.cutoff < 0.5 * sample_rate)) {
    throw DataError(fmt::format(
        "{}: cut-off {:.6g} Hz; the log has {:.6g} samples a second; expected more than 0 and less "
        "than {:.6g} Hz; choose a lower cut-off",
        path, options.cutoff, sample_rate, 0.5 * sample_rate));
  }
  return options.cutoff;
}

void refuse_short_log(const std::string& path, long samples) {
  throw DataError(fmt::format(
      "{}: {} samples; expected at least {} to derive velocity and acceleration; give a longer log", path,
      samples, kLeastSamples));
}

DerivedMotion derive_on_grid(const Eigen::VectorXd& grid, const Eigen::MatrixXd& q, double sample_rate,
                             double cutoff, const MotionOptions& options) {
  DerivedMotion motion;
  if (options.method == DerivativeMethod::kSavitzkyGolay && cutoff > 0.0) {
    check_order(options.polynomial_order, 2);
    const int window = savitzky_golay_window(cutoff, sample_rate, options.polynomial_order);
    motion.q = savitzky_golay(q, sample_rate, window, options.polynomial_order, 0);
    motion.qd = savitzky_golay(q, sample_rate, window, options.polynomial_order, 1);
    motion.qdd = savitzky_golay(q, sample_rate, window, options.polynomial_order, 2);
    return motion;
  }
  motion.q = cutoff > 0.0 ? low_pass_zero_phase(q, sample_rate, cutoff) : q;
  motion.qd = differentiate(grid, motion.q, options.stencil);
  motion.qdd = differentiate(grid, motion.qd, options.stencil);
  return motion;
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
  const auto to_grid = [&](const Eigen::MatrixXd& x) {
    return report.resampled ? resample(log.time, x, grid) : x;
  };
  const auto from_grid = [&](const Eigen::MatrixXd& x) {
    return report.resampled ? resample(grid, x, log.time) : x;
  };

  // 2. The cut-off.
  const Eigen::MatrixXd q = to_grid(log.q);
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
    log.qdd = from_grid(derive_on_grid(grid, to_grid(log.qd), report.sample_rate, report.cutoff, options).qd);
  }
  report.acceleration_derived = need_acceleration;
  return report;
}

}  // namespace heft::data
