#include "savitzky_golay.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

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

}  // namespace

void check_order(int order, int least) {
  if (order < least || order > kHighestOrder) {
    throw DataError(
        fmt::format("Savitzky-Golay: polynomial order {}; expected {} to {}", order, least, kHighestOrder));
  }
}

Eigen::MatrixXd savitzky_golay(const Eigen::Ref<const Eigen::MatrixXd>& signal, double sample_rate, int window, int order,
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

}  // namespace heft::data
