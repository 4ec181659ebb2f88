/// @file
/// Recursive least squares in UD-factored covariance form.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "heft/core/status.hpp"

namespace heft {

/// Estimates x from y = w x + e one scalar row at a time, P = U D Uᵀ kept in factors so that it stays positive
/// definite in float as well.
///
/// Measurement update by Bierman's algorithm (G. J. Bierman, Factorization Methods for Discrete Sequential
/// Estimation, 1977, ch. V). Cost of update(): 1.5 p² + 5.5 p multiplications, p divisions; no allocation.
///
/// Does not wind up: forgetting inflates only the directions the row informs about (it acts through that row's
/// own update), and no variance grows past its initial value.
///
/// @tparam P  number of parameters p
template <typename Scalar, int P>
class RecursiveLeastSquares {
 public:
  using Row = std::array<Scalar, P>;

  struct Config {
    Scalar forgetting_factor{1};   ///< λ a row, 0 < λ ≤ 1; 1 forgets nothing
    Scalar noise_variance{1};      ///< of the measurement, > 0 [squared unit of y]
    Scalar gate{0};                ///< rejects a row whose innovation exceeds gate standard deviations; 0: never
  };

  /// What happened to a row.
  struct Record {
    Scalar innovation{0};           ///< y − w x before the update
    Scalar innovation_variance{0};  ///< w P wᵀ + noise variance
    Scalar test_ratio{0};           ///< innovation² / (gate² variance); above 1 is rejected
    bool used{false};
  };

  /// Takes prior and settings. @return kOutOfRange, state kept
  Status configure(const Config& config, const Row& prior, const Row& variance) noexcept {
    if (!(config.forgetting_factor > Scalar(0)) || config.forgetting_factor > Scalar(1) ||
        !(config.noise_variance > Scalar(0)) || config.gate < Scalar(0)) {
      return Status::kOutOfRange;
    }
    for (const Scalar& v : variance) {
      if (!(v > Scalar(0))) {
        return Status::kOutOfRange;
      }
    }
    config_ = config;
    x_ = prior;
    d_ = variance;
    ceiling_ = variance;
    for (Row& row : u_) {
      row.fill(Scalar(0));
    }
    configured_ = true;
    return Status::kOk;
  }

  /// Takes one row.
  /// @param w  regressor row, p
  /// @param y  measurement
  /// @param noise_variance  of this row; 0 takes the configured one
  /// @return kNonFiniteInput, kNotConfigured: nothing changed
  Status update(const Row& w, Scalar y, Scalar noise_variance, Record& record) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    Scalar finite = y - y;
    for (const Scalar& v : w) {
      finite += v - v;
    }
    if (!(finite == Scalar(0))) {
      return Status::kNonFiniteInput;
    }
    const Scalar noise = noise_variance > Scalar(0) ? noise_variance : config_.noise_variance;

    // f = Uᵀ wᵀ, g = D f, variance = wᵀ P w.
    Row f = w;
    for (std::size_t j = 1; j < kSize; ++j) {
      for (std::size_t i = 0; i < j; ++i) {
        f[j] += u_[i][j] * w[i];
      }
    }
    Row g{};
    Scalar information = Scalar(0);
    Scalar innovation = y;
    for (std::size_t j = 0; j < kSize; ++j) {
      g[j] = d_[j] * f[j];
      information += f[j] * g[j];
      innovation -= w[j] * x_[j];
    }
    record.innovation = innovation;
    record.innovation_variance = information + noise;
    if (config_.gate > Scalar(0)) {
      record.test_ratio = innovation * innovation / (config_.gate * config_.gate * record.innovation_variance);
      if (record.test_ratio > Scalar(1)) {
        return Status::kOk;
      }
    }

    // Bierman's update, column by column; b collects the unscaled gain.
    Row b{};
    Scalar alpha = noise;
    Scalar inverse = Scalar(1) / alpha;
    for (std::size_t j = 0; j < kSize; ++j) {
      const Scalar previous = alpha;
      const Scalar previous_inverse = inverse;
      alpha += f[j] * g[j];
      inverse = Scalar(1) / alpha;
      d_[j] = d_[j] * previous * inverse;
      b[j] = g[j];
      const Scalar lambda = -f[j] * previous_inverse;
      for (std::size_t i = 0; i < j; ++i) {
        const Scalar u = u_[i][j];
        u_[i][j] = u + lambda * b[i];
        b[i] += u * g[j];
      }
    }
    const Scalar gain = innovation * inverse;
    for (std::size_t j = 0; j < kSize; ++j) {
      x_[j] += b[j] * gain;
    }
    if (config_.forgetting_factor < Scalar(1) && information > Scalar(0)) {
      forget(f, g, information, noise);
    }
    record.used = true;
    ++updates_;
    return Status::kOk;
  }

  const Row& solution() const noexcept { return x_; }

  /// Variance of w x for a row w: wᵀ P w.
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

  /// Variance of parameter i. Scale it by the residual variance over the noise variance where the latter was a guess.
  Scalar variance(int i) const noexcept {
    Row unit{};
    unit[static_cast<std::size_t>(i)] = Scalar(1);
    return variance(unit);
  }

  /// Rows used so far.
  long updates() const noexcept { return updates_; }

  /// Multiplies all variances, up to their initial values: after a known change of tool or load.
  void inflate(Scalar factor) noexcept {
    for (std::size_t j = 0; j < kSize; ++j) {
      d_[j] = d_[j] * factor > ceiling_[j] ? ceiling_[j] : d_[j] * factor;
    }
  }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(P);

  // Directional: only factors this row has informed about (f_j² d_j is its share) are relaxed towards 1/λ.
  void forget(const Row& f, const Row& g, const Scalar& information, const Scalar& noise) noexcept {
    const Scalar strength = (Scalar(1) / config_.forgetting_factor - Scalar(1)) / (information + noise);
    for (std::size_t j = 0; j < kSize; ++j) {
      const Scalar inflated = d_[j] * (Scalar(1) + strength * f[j] * g[j] * static_cast<Scalar>(P));
      d_[j] = inflated > ceiling_[j] ? (d_[j] > ceiling_[j] ? d_[j] : ceiling_[j]) : inflated;
    }
  }

  Config config_{};
  std::array<Row, kSize> u_{};  ///< strictly upper triangle of U; ones on the diagonal not stored
  Row d_{}, ceiling_{}, x_{};
  long updates_{0};
  bool configured_{false};
};

}  // namespace heft
