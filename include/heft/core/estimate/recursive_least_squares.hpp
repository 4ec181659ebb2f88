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
/// Does not wind up. Forgetting divides D by λ after each row that carries information; to balance it, each such row is
/// followed by one pseudo-measurement of one parameter in turn, "you are where you are", whose weight is such that
/// without any other information the variance returns to its initial value and no higher (leakage towards the prior covariance).
/// It moves no estimate and costs a second update(), with λ < 1 only.
///
/// @tparam P  number of parameters p
template <typename Scalar, int P>
class RecursiveLeastSquares {
 public:
  using Row = std::array<Scalar, P>;

  struct Config {
    Scalar forgetting_factor{1};  ///< λ a row, 0 < λ ≤ 1; 1 forgets nothing
    Scalar noise_variance{1};     ///< of the measurement, > 0 [squared unit of y]
    Scalar gate{0};  ///< rejects a row whose innovation exceeds gate standard deviations; 0: never
    /// Share of the noise variance that one row shows. Below 1 where the noise is correlated in time and
    /// noise_variance is raised for it: weight and variances then count the information rightly, while the gate
    /// goes by the scatter of single rows.
    Scalar gate_noise_share{1};
  };

  /// What happened to a row.
  struct Record {
    Scalar innovation{0};           ///< y − w x before the update
    Scalar innovation_variance{0};  ///< w P wᵀ + gate_noise_share · noise variance
    Scalar test_ratio{0};           ///< innovation² / (gate² variance); above 1 is rejected
    bool used{false};
  };

  /// Takes prior and settings. @return kOutOfRange, state kept
  Status configure(const Config& config, const Row& prior, const Row& variance) noexcept {
    if (!(config.forgetting_factor > Scalar(0)) || config.forgetting_factor > Scalar(1) ||
        !(config.noise_variance > Scalar(0)) || config.gate < Scalar(0) ||
        !(config.gate_noise_share > Scalar(0)) || config.gate_noise_share > Scalar(1)) {
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
    Scalar power = Scalar(1);
    for (int i = 0; i < P; ++i) {
      power = power * config.forgetting_factor;
    }
    leak_noise_ = power < Scalar(1) ? power / (Scalar(1) - power) : Scalar(1);
    leak_ = 0;
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
    record.innovation_variance = information + config_.gate_noise_share * noise;
    if (config_.gate > Scalar(0)) {
      record.test_ratio =
          innovation * innovation / (config_.gate * config_.gate * record.innovation_variance);
      if (record.test_ratio > Scalar(1)) {
        return Status::kOk;
      }
    }

    const Row gain = reduce(f, g, noise);
    for (std::size_t j = 0; j < kSize; ++j) {
      x_[j] += gain[j] * innovation;
    }
    if (config_.forgetting_factor < Scalar(1) && information > Scalar(0)) {
      forget();
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

  /// Entry (i, j) of P = U D Uᵀ.
  Scalar covariance(int i, int j) const noexcept {
    const std::size_t low = static_cast<std::size_t>(i < j ? i : j);
    const std::size_t high = static_cast<std::size_t>(i < j ? j : i);
    Scalar sum = (low == high ? Scalar(1) : u_[low][high]) * d_[high];
    for (std::size_t k = high + 1; k < kSize; ++k) {
      sum += u_[low][k] * d_[k] * u_[high][k];
    }
    return sum;
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

  // Bierman's update of U and D, column by column. f = Uᵀ wᵀ, g = D f. Returns the gain P wᵀ / (w P wᵀ + noise).
  Row reduce(const Row& f, const Row& g, const Scalar& noise) noexcept {
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
    for (Scalar& entry : b) {
      entry = entry * inverse;
    }
    return b;
  }

  // Division by λ, then the leak of one parameter. Each is reached once in p rows, over which its information falls by
  // λ^p: a pseudo-measurement of information (1 − λ^p) / (λ^p ceiling) lets the variance swing up to the ceiling.
  void forget() noexcept {
    const Scalar inverse = Scalar(1) / config_.forgetting_factor;
    for (Scalar& d : d_) {
      d = d * inverse;
    }
    const std::size_t k = leak_;
    leak_ = leak_ + 1 == kSize ? 0 : leak_ + 1;
    Row f{};
    Row g{};
    f[k] = Scalar(1);
    for (std::size_t j = k + 1; j < kSize; ++j) {
      f[j] = u_[k][j];
    }
    for (std::size_t j = k; j < kSize; ++j) {
      g[j] = d_[j] * f[j];
    }
    static_cast<void>(reduce(f, g, ceiling_[k] * leak_noise_));
  }

  Config config_{};
  std::array<Row, kSize> u_{};  ///< strictly upper triangle of U; ones on the diagonal not stored
  Row d_{}, ceiling_{}, x_{};
  Scalar leak_noise_{1};  ///< λ^p / (1 − λ^p)
  std::size_t leak_{0};
  long updates_{0};
  bool configured_{false};
};

}  // namespace heft
