/// @file
/// Recursive least squares in UD-factored covariance form.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "heft/core/estimate/detail/ud_factors.hpp"
#include "heft/core/estimate/innovation_gate.hpp"
#include "heft/core/numeric_range.hpp"
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
/// What the data do not show is kept, but for rounding: after 10⁸ rows of one and the same regressor a parameter they
/// do not determine has wandered by up to twice its standard_deviation in float (0.4 of it in double), and is right
/// again soon after the motion returns. Leave samples at standstill out where that matters.
///
/// Where one sample has several rows, call add() for each and forget() once: λ is then a sample's. update() does both.
///
/// @tparam P  number of parameters p
template <typename Scalar, int P>
class RecursiveLeastSquares {
 public:
  using Row = std::array<Scalar, P>;

  struct Config {
    Scalar forgetting_factor{1};  ///< λ a call of forget(), ≤ 1 with λᵖ ≥ 1e-12; 1 forgets nothing
    /// Variance of the measurement, within kLargestWeight and its inverse [squared unit of y].
    Scalar noise_variance{1};
    /// Rejects a row whose innovation exceeds gate standard deviations. 0: never; then one wild row (w or y far too
    /// large) moves the estimate by as much as it asks for, and stays until it is forgotten, with λ = 1 for ever.
    Scalar gate{0};
    /// How readily the gate lets in a change that lasts, see InnovationGate, 0 to 0.25; 0: not at all.
    Scalar gate_widening{static_cast<Scalar>(0.01)};
    /// Share of the noise variance that one row shows. Below 1 where the noise is correlated in time and
    /// noise_variance is raised for it: weight and variances then count the information rightly, while the gate
    /// goes by the scatter of single rows.
    Scalar gate_noise_share{1};
  };

  /// Treatment of a row.
  struct Record {
    Scalar innovation{0};           ///< y − w x before the update
    Scalar innovation_variance{0};  ///< w P wᵀ + gate_noise_share · noise variance
    Scalar test_ratio{0};  ///< innovation² / (gate² variance); above usual² of the gate is rejected
    bool used{false};
  };

  /// Takes prior and settings.
  /// @param prior     x before any data, p
  /// @param variance  of the prior, p, each within kLargestWeight and its inverse
  /// @return kOutOfRange, kNonFiniteInput (of the prior): state kept
  Status configure(const Config& config, const Row& prior, const Row& variance) noexcept {
    Scalar power = Scalar(1);
    for (int i = 0; i < P; ++i) {
      power = power * config.forgetting_factor;
    }
    if (!(config.forgetting_factor > Scalar(0) && config.forgetting_factor <= Scalar(1)) ||
        !(power >= static_cast<Scalar>(1e-12)) || !is_usable_weight(config.noise_variance) ||
        !(config.gate >= Scalar(0) && is_usable(config.gate)) ||
        !(config.gate_widening >= Scalar(0) && config.gate_widening <= static_cast<Scalar>(0.25)) ||
        !(config.gate_noise_share > Scalar(0) && config.gate_noise_share <= Scalar(1))) {
      return Status::kOutOfRange;
    }
    for (const Scalar& v : variance) {
      if (!is_usable_weight(v)) {
        return Status::kOutOfRange;
      }
    }
    if (!all_usable(prior)) {
      return Status::kNonFiniteInput;
    }
    config_ = config;
    x_ = prior;
    covariance_.set_diagonal(variance);
    ceiling_ = variance;
    leak_noise_ = power < Scalar(1) ? power / (Scalar(1) - power) : Scalar(1);
    leak_ = 0;
    informed_ = false;
    gate_.reset();
    configured_ = true;
    return Status::kOk;
  }

  /// Takes one row and forgets: add() and forget().
  Status update(const Row& w, Scalar y, Scalar noise_variance, Record& record) noexcept {
    const Status status = add(w, y, noise_variance, gate_, record);
    if (status == Status::kOk) {
      forget();
    }
    return status;
  }

  /// Takes one row.
  /// @param w  regressor row, p
  /// @param y  measurement
  /// @param noise_variance  of this row; 0 takes the configured one
  /// @param gate  of the channel that the row comes from, so that a change that shows in one of them is let in there
  /// @return kNonFiniteInput (also for a number beyond kLargestInput), kOutOfRange (noise_variance), kNotConfigured:
  ///         nothing changed
  Status add(const Row& w, Scalar y, Scalar noise_variance, InnovationGate<Scalar>& gate,
             Record& record) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!is_usable(y) || !is_usable(noise_variance) || !all_usable(w)) {
      return Status::kNonFiniteInput;
    }
    const Scalar noise = noise_variance == Scalar(0) ? config_.noise_variance : noise_variance;
    if (!is_usable_weight(noise)) {
      return Status::kOutOfRange;
    }

    // f = Uᵀ wᵀ, g = D f, variance = wᵀ P w.
    const Row f = covariance_.times_upper(w);
    Row g{};
    Scalar information = Scalar(0);
    Scalar innovation = y;
    for (std::size_t j = 0; j < kSize; ++j) {
      g[j] = covariance_.pivot(j) * f[j];
      information += f[j] * g[j];
      innovation -= w[j] * x_[j];
    }
    // The ranges of the inputs keep these finite; were they not, the row must not get into the factors.
    if (!is_finite(information) || !is_finite(innovation)) {
      return Status::kNonFiniteInput;
    }
    record.innovation = innovation;
    record.innovation_variance = information + config_.gate_noise_share * noise;
    if (config_.gate > Scalar(0)) {
      using std::abs;
      using std::sqrt;
      const Scalar deviations = abs(innovation) / sqrt(record.innovation_variance);
      const Scalar of_gate = deviations / config_.gate;
      record.test_ratio = of_gate * of_gate;
      if (gate.refuses(deviations, config_.gate, config_.gate_widening)) {
        return Status::kOk;
      }
    }

    const Row gain = covariance_.reduce(f, g, noise, ceiling_);
    for (std::size_t j = 0; j < kSize; ++j) {
      x_[j] += gain[j] * innovation;
    }
    informed_ = informed_ || information > Scalar(0);
    record.used = true;
    ++updates_;
    return Status::kOk;
  }

  /// Forgets one step, if a row since the last call carried information: D is divided by λ, and one parameter leaks.
  void forget() noexcept {
    if (!informed_ || !(config_.forgetting_factor < Scalar(1))) {
      return;
    }
    informed_ = false;
    covariance_.scale(Scalar(1) / config_.forgetting_factor);
    leak();
  }

  const Row& solution() const noexcept { return x_; }

  /// Variance of w x for a row w: wᵀ P w.
  Scalar variance(const Row& w) const noexcept { return covariance_.variance(w); }

  /// The same of wi times parameter i plus wj times parameter j, i < j. Cost 4 p.
  Scalar variance(int i, const Scalar& wi, int j, const Scalar& wj) const noexcept {
    return covariance_.variance(static_cast<std::size_t>(i), wi, static_cast<std::size_t>(j), wj);
  }

  /// Variance of parameter i. Scale it by the residual variance over the noise variance where the latter was a guess.
  Scalar variance(int i) const noexcept {
    Row unit{};
    unit[static_cast<std::size_t>(i)] = Scalar(1);
    return variance(unit);
  }

  /// Entry (i, j) of P = U D Uᵀ.
  Scalar covariance(int i, int j) const noexcept {
    return covariance_.covariance(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }

  /// Rows used so far.
  long updates() const noexcept { return updates_; }

  /// Parameter i has changed, by as much as the prior allows: its variance becomes the prior's again, and what is known of the
  /// others stays. Cost i² + p multiplications: those that change belong to the front.
  void widen(int i) noexcept {
    const std::size_t k = static_cast<std::size_t>(i);
    const Scalar room = ceiling_[k] - covariance(i, i);
    if (configured_ && room > Scalar(0)) {
      Row unit{};
      unit[k] = Scalar(1);
      covariance_.add(unit, room);
    }
  }

  /// The same where its new value is roughly known; finite.
  void replace(int i, const Scalar& value) noexcept {
    widen(i);
    x_[static_cast<std::size_t>(i)] = configured_ ? value : x_[static_cast<std::size_t>(i)];
  }

  /// Multiplies all variances by one factor, or by the largest smaller one that leaves none above its initial value:
  /// after a known change of tool or load. Cost p³/6 multiplications.
  /// @param factor  ≥ 1
  /// @return kOutOfRange, kNotConfigured: nothing changed
  Status inflate(Scalar factor) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!(factor >= Scalar(1)) || !is_usable(factor)) {
      return Status::kOutOfRange;
    }
    Scalar allowed = factor;
    for (std::size_t i = 0; i < kSize; ++i) {
      const Scalar present = covariance(static_cast<int>(i), static_cast<int>(i));
      if (present * allowed > ceiling_[i]) {
        allowed = ceiling_[i] / present;
      }
    }
    if (allowed > Scalar(1)) {
      covariance_.scale(allowed);
    }
    return Status::kOk;
  }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(P);

  // Each parameter is reached once in p steps, over which its information falls by λ^p: a pseudo-measurement of
  // information (1 − λ^p) / (λ^p ceiling) lets the variance swing up to the ceiling.
  void leak() noexcept {
    const std::size_t k = leak_;
    leak_ = leak_ + 1 == kSize ? 0 : leak_ + 1;
    Row f{};
    Row g{};
    f[k] = Scalar(1);
    for (std::size_t j = k + 1; j < kSize; ++j) {
      f[j] = covariance_.upper(k, j);
    }
    for (std::size_t j = k; j < kSize; ++j) {
      g[j] = covariance_.pivot(j) * f[j];
    }
    static_cast<void>(covariance_.reduce(f, g, ceiling_[k] * leak_noise_, ceiling_));
  }

  Config config_{};
  detail::UdFactors<Scalar, P> covariance_;
  Row ceiling_{}, x_{};
  Scalar leak_noise_{1};  ///< λ^p / (1 − λ^p)
  std::size_t leak_{0};
  long updates_{0};
  InnovationGate<Scalar> gate_;
  bool configured_{false};
  bool informed_{false};  ///< a row since the last forget() carried information
};

}  // namespace heft
