/// @file
/// A covariance in factors P = U D Uᵀ, U unit upper triangular: positive definite whatever the rounding.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

namespace heft::detail {

/// Bierman's and Agee and Turner's updates (G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977,
/// ch. III and V). Weights and variances that go in are positive, so that no entry of D can become negative.
///
/// @tparam P  size p
template <typename Scalar, int P>
class UdFactors {
 public:
  using Row = std::array<Scalar, P>;

  /// U = 1, D = the variances.
  void set_diagonal(const Row& variance) noexcept {
    d_ = variance;
    for (Row& row : u_) {
      row.fill(Scalar(0));
    }
  }

  /// f = Uᵀ wᵀ. Cost p²/2.
  Row times_upper(const Row& w) const noexcept {
    Row f = w;
    for (std::size_t j = 1; j < kSize; ++j) {
      for (std::size_t i = 0; i < j; ++i) {
        f[j] += u_[i][j] * w[i];
      }
    }
    return f;
  }

  /// z with U z = w. Cost p²/2.
  Row solve_upper(const Row& w) const noexcept {
    Row z = w;
    for (std::size_t i = kSize; i-- > 0;) {
      for (std::size_t k = i + 1; k < kSize; ++k) {
        z[i] -= u_[i][k] * z[k];
      }
    }
    return z;
  }

  /// w P wᵀ.
  Scalar variance(const Row& w) const noexcept {
    Scalar sum = Scalar(0);
    for (std::size_t j = 0; j < kSize; ++j) {
      Scalar f = w[j];
      for (std::size_t i = 0; i < j; ++i) {
        f += u_[i][j] * w[i];
      }
      sum += f * f * d_[j];
    }
    return sum;
  }

  /// The same of a row with two entries, i < j. Cost 4 p.
  Scalar variance(std::size_t i, const Scalar& wi, std::size_t j, const Scalar& wj) const noexcept {
    const auto upper = [this](std::size_t row, std::size_t column) {
      return row == column ? Scalar(1) : u_[row][column];
    };
    Scalar sum = Scalar(0);
    for (std::size_t k = i; k < kSize; ++k) {
      const Scalar f = upper(i, k) * wi + (k < j ? Scalar(0) : upper(j, k) * wj);
      sum += f * f * d_[k];
    }
    return sum;
  }

  /// Entry (i, j) of P.
  Scalar covariance(std::size_t i, std::size_t j) const noexcept {
    const std::size_t low = i < j ? i : j;
    const std::size_t high = i < j ? j : i;
    Scalar sum = (low == high ? Scalar(1) : u_[low][high]) * d_[high];
    for (std::size_t k = high + 1; k < kSize; ++k) {
      sum += u_[low][k] * d_[k] * u_[high][k];
    }
    return sum;
  }

  /// P ← P − P wᵀ w P / (w P wᵀ + noise): one measurement, by Bierman. Cost p² + 5 p multiplications, p + 1 divisions.
  /// @param f        Uᵀ wᵀ
  /// @param g        D f
  /// @param noise    variance of the measurement, > 0
  /// @param ceiling  variances, p: an entry of D does not fall below kSmallestShare of its own
  /// @return gain P wᵀ / (w P wᵀ + noise)
  Row reduce(const Row& f, const Row& g, const Scalar& noise, const Row& ceiling) noexcept {
    Row b = g;
    Scalar alpha = noise;
    Scalar inverse = Scalar(1) / alpha;
    for (std::size_t j = 0; j < kSize; ++j) {
      const Scalar previous = alpha;
      const Scalar previous_inverse = inverse;
      alpha += f[j] * g[j];
      inverse = Scalar(1) / alpha;
      d_[j] = d_[j] * (previous * inverse);
      // A variance of nothing could never grow again.
      const Scalar floor = ceiling[j] * static_cast<Scalar>(kSmallestShare);
      d_[j] = d_[j] > floor ? d_[j] : floor;
      const Scalar lambda = -f[j] * previous_inverse;
      for (std::size_t i = 0; i < j; ++i) {
        const Scalar u = u_[i][j];
        u_[i][j] = u + lambda * b[i];
        b[i] += u * g[j];
      }
    }
    for (Scalar& entry : b) {
      entry = entry * inverse;
    }
    return b;
  }

  /// P ← P + weight a aᵀ, by Agee and Turner. Cost p² + 5 p multiplications, p divisions; less where a ends in zeros.
  /// @param weight  ≥ 0
  void add(Row a, Scalar weight) noexcept {
    for (std::size_t j = kSize; j-- > 0;) {
      if (!(a[j] > Scalar(0) || a[j] < Scalar(0))) {
        continue;
      }
      const Scalar grown = d_[j] + weight * a[j] * a[j];
      const Scalar inverse = Scalar(1) / grown;
      const Scalar share = weight * a[j] * inverse;
      weight = weight * d_[j] * inverse;
      d_[j] = grown;
      for (std::size_t k = 0; k < j; ++k) {
        a[k] -= a[j] * u_[k][j];
        u_[k][j] += share * a[k];
      }
    }
  }

  /// Multiplies P.
  void scale(const Scalar& factor) noexcept {
    for (Scalar& d : d_) {
      d = d * factor;
    }
  }

  /// Multiplies unknown i by a factor: row and column i of P.
  /// @param factor  not 0
  void scale_unknown(std::size_t i, const Scalar& factor) noexcept {
    const Scalar inverse = Scalar(1) / factor;
    for (std::size_t j = i + 1; j < kSize; ++j) {
      u_[i][j] = u_[i][j] * factor;
    }
    for (std::size_t k = 0; k < i; ++k) {
      u_[k][i] = u_[k][i] * inverse;
    }
    d_[i] = d_[i] * (factor * factor);
  }

  /// Entry (i, j) of U, i < j.
  Scalar& upper(std::size_t i, std::size_t j) noexcept { return u_[i][j]; }
  const Scalar& upper(std::size_t i, std::size_t j) const noexcept { return u_[i][j]; }
  /// Entry i of D.
  Scalar& pivot(std::size_t i) noexcept { return d_[i]; }
  const Scalar& pivot(std::size_t i) const noexcept { return d_[i]; }

  /// Smallest entry of D, as a share of a ceiling; a standard deviation of 1e-10 (float), 1e-30.
  static constexpr double kSmallestShare = std::is_same_v<Scalar, float> ? 1e-20 : 1e-60;

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(P);

  std::array<Row, kSize> u_{};  ///< strictly upper triangle of U; ones on the diagonal not stored
  Row d_{};
};

}  // namespace heft::detail
