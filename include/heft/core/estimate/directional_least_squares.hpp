/// @file
/// Recursive least squares that forgets only in the directions in which new data arrive.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "heft/core/estimate/detail/ud_factors.hpp"
#include "heft/core/estimate/innovation_gate.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Estimates x from y = W x + e, m rows a sample, with directional forgetting (L. Cao, H. Schwartz, A directional forgetting
/// algorithm based on the decomposition of the information matrix, Automatica 36, 2000; here for any number of rows).
///
/// The information R = P⁻¹ is divided into the part that the rows of the sample see and the rest, which they are blind to:
/// R₂ = R Wᵀ (W R Wᵀ)⁻¹ W R and R − R₂. Only R₂ is multiplied by λ, then the rows come in:
///
///     R ← R − (1 − λ) R₂ + Wᵀ W / σ²,    P̄ = P + (1 − λ) / λ · Wᵀ (W R Wᵀ)⁻¹ W.
///
/// What the motion does not show is kept for ever, as it was; what it shows follows: a direction that every sample shows
/// with a time constant of 1 / (1 − λ) samples, p directions that m rows take turns through with p/m times that. Exponential
/// forgetting divides the whole of R and winds up (P grows without bound in directions that get no data);
/// leakage (RecursiveLeastSquares) lets those directions return to the prior covariance. README.md, section 12, compares them.
///
/// P stays bounded without excitation: a row that could not improve even the prior (w P₀ wᵀ < σ²) makes nothing be forgotten,
/// and no variance of a parameter grows beyond that of its prior. A row left out by the gate makes nothing be forgotten either.
///
/// P = U D Uᵀ in factors: forgetting is a positive update of them (Agee and Turner), a row Bierman's. The rows of a sample are made
/// conjugate to one another first, so that a direction which several of them share is forgotten once. Cost a row: at most 6 p²
/// + 1.5 m p + 2 p multiplications (p = 12, m = 6: 5910 a sample where all rows inform and none lies in the span of the others, 4205
/// where they span two directions), 5 p divisions; no allocation.
///
/// @tparam P     number of parameters p
/// @tparam Rows  rows a sample m
template <typename Scalar, int P, int Rows = 1>
class DirectionalLeastSquares {
  static_assert(Rows >= 1 && Rows <= 32, "one bit of Record::used a row");

 public:
  using Row = std::array<Scalar, P>;
  using Sample = std::array<Row, Rows>;
  using Values = std::array<Scalar, Rows>;

  struct Config {
    Scalar forgetting_factor{static_cast<Scalar>(0.99)};  ///< λ a sample, 0.01 to 1; 1 forgets nothing
    Values noise_variance = filled(Scalar(1));            ///< of each row, as in RecursiveLeastSquares
    Scalar gate{0};  ///< [standard deviations] of an innovation before the sample; 0: every row is taken
    Scalar gate_widening{static_cast<Scalar>(0.01)};  ///< see InnovationGate, 0 to 0.25
  };

  struct Record {
    Values innovation{};           ///< y − w x before the sample
    Values innovation_variance{};  ///< w P wᵀ + noise variance
    std::uint32_t used{0};         ///< bit i: row i was taken
    std::uint32_t forgot{0};       ///< bit i: its direction was forgotten
  };

  /// @param prior     x before any data, p
  /// @param variance  of the prior, p, each within kLargestWeight and its inverse
  /// @return kOutOfRange, kNonFiniteInput (of the prior): state kept
  Status configure(const Config& config, const Row& prior, const Row& variance) noexcept {
    if (!(config.forgetting_factor >= static_cast<Scalar>(0.01) && config.forgetting_factor <= Scalar(1)) ||
        !(config.gate >= Scalar(0) && is_usable(config.gate)) ||
        !(config.gate_widening >= Scalar(0) && config.gate_widening <= static_cast<Scalar>(0.25))) {
      return Status::kOutOfRange;
    }
    for (const Scalar& v : variance) {
      if (!is_usable_weight(v)) {
        return Status::kOutOfRange;
      }
    }
    for (const Scalar& v : config.noise_variance) {
      if (!is_usable_weight(v)) {
        return Status::kOutOfRange;
      }
    }
    if (!all_usable(prior)) {
      return Status::kNonFiniteInput;
    }
    config_ = config;
    x_ = prior;
    ceiling_ = variance;
    covariance_.set_diagonal(variance);
    for (auto& gate : gate_) {
      gate.reset();
    }
    configured_ = true;
    return Status::kOk;
  }

  /// Takes one sample.
  /// @param w  regressor rows, m × p
  /// @param y  measurements, m
  /// @return kNonFiniteInput (also for a number beyond kLargestInput), kNotConfigured: nothing changed
  Status update(const Sample& w, const Values& y, Record& record) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    bool usable = all_usable(y);
    for (const Row& row : w) {
      usable = usable && all_usable(row);
    }
    if (!usable) {
      return Status::kNonFiniteInput;
    }
    if (!judge(w, y, record)) {
      record = Record{};
      return Status::kNonFiniteInput;
    }
    if (config_.forgetting_factor < Scalar(1)) {
      forget(w, record);
    }
    for (std::size_t r = 0; r < kRows; ++r) {
      if ((record.used >> r & 1U) != 0) {
        add(w[r], y[r], config_.noise_variance[r]);
      }
    }
    return Status::kOk;
  }

  const Row& solution() const noexcept { return x_; }
  /// Variance of w x for a row w.
  Scalar variance(const Row& w) const noexcept { return covariance_.variance(w); }
  /// Variance of parameter i, at most that of the prior.
  Scalar variance(int i) const noexcept { return covariance(i, i); }
  Scalar covariance(int i, int j) const noexcept {
    return covariance_.covariance(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(P);
  static constexpr std::size_t kRows = static_cast<std::size_t>(Rows);
  /// A row whose length, in the metric of R, shrinks to less than this when it is made conjugate to the others lies in their span:
  /// what is left is rounding.
  static constexpr double kInSpan = 1e-3;

  static constexpr Values filled(const Scalar& value) noexcept {
    Values values{};
    for (Scalar& v : values) {
      v = value;
    }
    return values;
  }

  // Innovations and gates, all before the sample. false: a number got out of hand; the gates are as they were.
  bool judge(const Sample& w, const Values& y, Record& record) noexcept {
    for (std::size_t r = 0; r < kRows; ++r) {
      Scalar innovation = y[r];
      for (std::size_t j = 0; j < kSize; ++j) {
        innovation -= w[r][j] * x_[j];
      }
      record.innovation[r] = innovation;
      record.innovation_variance[r] = covariance_.variance(w[r]) + config_.noise_variance[r];
      if (!is_finite(innovation) || !is_finite(record.innovation_variance[r])) {
        return false;
      }
    }
    for (std::size_t r = 0; r < kRows; ++r) {
      bool refused = false;
      if (config_.gate > Scalar(0)) {
        using std::abs;
        using std::sqrt;
        refused = gate_[r].refuses(abs(record.innovation[r]) / sqrt(record.innovation_variance[r]),
                                   config_.gate, config_.gate_widening);
      }
      record.used |= refused ? 0U : std::uint32_t{1} << r;
    }
    return true;
  }

  // P + (1 − λ)/λ Σ ψψᵀ / (ψᵀ R ψ) over directions ψ that span the rows and are conjugate: ψᵀ R ψ' = 0.
  void forget(const Sample& w, Record& record) noexcept {
    const Scalar share = (Scalar(1) - config_.forgetting_factor) / config_.forgetting_factor;
    int count = 0;
    for (std::size_t r = 0; r < kRows; ++r) {
      if ((record.used >> r & 1U) == 0 || !informs(w[r], config_.noise_variance[r])) {
        continue;
      }
      const std::size_t n = static_cast<std::size_t>(count);
      direction_[n] = w[r];
      // ψᵀ R ψ = zᵀ D⁻¹ z with U z = ψ.
      Row z = covariance_.solve_upper(w[r]);
      const Scalar whole = information(z, z);
      for (std::size_t k = 0; k < n; ++k) {
        const Scalar part = information(z, image_[k]) / length_[k];
        for (std::size_t j = 0; j < kSize; ++j) {
          z[j] -= part * image_[k][j];
          direction_[n][j] -= part * direction_[k][j];
        }
      }
      length_[n] = information(z, z);
      image_[n] = z;
      if (is_finite(length_[n]) && length_[n] > static_cast<Scalar>(kInSpan * kInSpan) * whole) {
        ++count;
        record.forgot |= std::uint32_t{1} << r;
      }
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      covariance_.add(direction_[k], allowed(direction_[k], share / length_[k]));
    }
  }

  bool informs(const Row& w, const Scalar& noise) const noexcept {
    Scalar sum = Scalar(0);
    for (std::size_t j = 0; j < kSize; ++j) {
      sum += w[j] * w[j] * ceiling_[j];
    }
    return sum >= noise;
  }

  // The weight, or the largest smaller one that lifts no variance above its ceiling.
  Scalar allowed(const Row& direction, Scalar weight) const noexcept {
    for (std::size_t j = 0; j < kSize; ++j) {
      const Scalar square = direction[j] * direction[j];
      const Scalar room = ceiling_[j] - covariance_.covariance(j, j);
      if (weight * square > room) {
        weight = room > Scalar(0) ? room / square : Scalar(0);
      }
    }
    return weight;
  }

  Scalar information(const Row& a, const Row& b) const noexcept {
    Scalar sum = Scalar(0);
    for (std::size_t j = 0; j < kSize; ++j) {
      sum += a[j] * b[j] / covariance_.pivot(j);
    }
    return sum;
  }

  void add(const Row& w, Scalar innovation, const Scalar& noise) noexcept {
    const Row f = covariance_.times_upper(w);
    Row g{};
    for (std::size_t j = 0; j < kSize; ++j) {
      g[j] = covariance_.pivot(j) * f[j];
      innovation -= w[j] * x_[j];
    }
    const Row gain = covariance_.reduce(f, g, noise, ceiling_);
    for (std::size_t j = 0; j < kSize; ++j) {
      x_[j] += gain[j] * innovation;
    }
  }

  Config config_{};
  detail::UdFactors<Scalar, P> covariance_;
  Row x_{}, ceiling_{};
  std::array<InnovationGate<Scalar>, Rows> gate_{};
  bool configured_{false};
  // Scratch: directions of the sample, U⁻¹ times them, and ψᵀ R ψ.
  Sample direction_{}, image_{};
  Values length_{};
};

}  // namespace heft
