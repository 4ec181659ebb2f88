/// @file
/// The terminal-link estimator: rows k..n, instruments, start-up, and when to say nothing.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/factored_equations.hpp"
#include "heft/core/estimate/magnitude_gate.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// How the estimate is kept.
enum class EstimatorForm : std::uint8_t {
  kInformation,  ///< accumulate, solve every so many samples, the solve spread over samples
  kFactored      ///< exact after every sample by rank-one updates of the factors
};

/// Source of the estimate handed out.
enum class EstimateSource : std::uint8_t {
  kPrior,         ///< the nominal values: the data do not determine anything better yet
  kLeastSquares,  ///< start-up: least squares, biased where accelerations are noisy
  kInstrumental   ///< instrumental variables
};

/// Name of a source, for people.
constexpr const char* to_string(EstimateSource source) noexcept {
  switch (source) {
    case EstimateSource::kPrior: return "prior";
    case EstimateSource::kLeastSquares: return "least squares";
    case EstimateSource::kInstrumental: return "instrumental variables";
  }
  return "unknown source";
}

/// Estimates the parameters that rows k..n of an arm see, sample by sample, from measured torques.
///
/// tau = Y x + ψ, in which the noise of the measured acceleration is both in Y and, through the mass matrix,
/// in ψ; least squares is biased by it, instruments made from another acceleration are not (Kawasaki and
/// Nishimura, 1984, (22)-(37), (46)-(54); equations with corrections and sections: README.md in this folder).
///
/// Numbers handed out are always usable: the prior until least squares is determined by the data, least squares
/// until the instrumental system passes its conditioning check, instrumental variables from then on.
///
/// Glitches stay out in two ways. A row whose regressor, instrument or torque is far larger than those of late is
/// refused from the start on (MagnitudeGate); once the estimate rests on data, so is a row whose innovation is far above
/// its usual size. Both let in what lasts. A sample with a number beyond kLargestInput is refused as a whole.
///
/// @tparam Arm    StaticArm
/// @tparam First  k − 1: first joint whose row is used
/// @tparam Form   how the estimate is kept
///
/// Cost a sample: bench/operation_count. No allocation, no exception, every loop bounded.
template <typename Arm, int First, EstimatorForm Form = EstimatorForm::kInformation>
class TerminalLinkEstimator {
 public:
  using Scalar = typename Arm::Scalar;
  using Description = typename Arm::Description;
  using Layout = TerminalLayout<Arm, First>;
  using Vector = typename Arm::Vector;
  using Rows = TerminalRows<Scalar, Layout>;
  static constexpr int kParameters = Layout::kParameters;
  static constexpr int kRows = Layout::kRows;
  using Row = std::array<Scalar, kParameters>;

  struct Config {
    /// Weight of each row, inverse to its noise variance (the diagonal of P² in (47)); 1 costs nothing. Within
    /// kLargestWeight and its inverse.
    std::array<Scalar, kRows> row_weight = filled(Scalar(1));
    Scalar forgetting_factor{1};  ///< λ a sample, 0.5 ≤ λ ≤ 1; held while the arm is at rest
    int solve_every{50};  ///< samples from one solve to the next, ≥ 2 (information form and start-up)
    /// P₀⁻¹ relative to the information of one unit row, ≥ 0, all parameters alike.
    Scalar prior_precision{0};
    bool use_instruments{true};  ///< false: least squares all along
    /// The instrumental system is trusted below this (StagedSolver::amplification).
    Scalar max_amplification{10};
    Scalar max_amplification_least_squares{30};  ///< and least squares below this
    int min_samples{200};                        ///< fewer samples never leave the prior
    /// A row whose innovation exceeds gate times its usual size is refused, as is one with numbers gate² times as large
    /// as the largest of late; ≥ 1. 0: both off; then one wild sample remains in the estimate until it is forgotten, with λ = 1 for ever.
    Scalar gate{8};
    /// Samples with all joints of the rows slower than this are left out [rad/s, m/s]: at rest friction takes up any
    /// torque below its level. 0: off; with λ < 1 a long standstill then wears the estimate away (half of a payload in
    /// ten hours) while source() remains and status() says that the solves fail. Set it above the noise of the velocity.
    Scalar standstill_speed{static_cast<Scalar>(0.01)};
    Scalar sign_width{0};  ///< of the Coulomb sign, see velocity_sign [rad/s]
  };

  /// Treatment of a sample.
  struct Record {
    std::array<Scalar, kRows> innovation{};  ///< torque minus prediction by the estimate before [N·m]
    std::array<bool, kRows> row_used{};  ///< false: refused by the gate, standstill or a non-finite number
    EstimateSource source{EstimateSource::kPrior};
    bool new_estimate{false};  ///< estimate() changed with this sample
    bool standstill{false};
  };

  /// Checks settings, forgets all data, starts at the nominal parameters.
  /// @param nominal   reduced parameters of the whole arm
  /// @param coulomb,viscous  nominal friction of all joints [N·m, N·m·s/rad]
  /// @return kOutOfRange, kNonFiniteInput: state kept
  Status configure(const Config& config, const ReducedParameters<Scalar, Description>& nominal,
                   const Vector& coulomb, const Vector& viscous) noexcept {
    const auto not_negative = [](const Scalar& value) { return value >= Scalar(0) && is_usable(value); };
    if (!(config.forgetting_factor >= static_cast<Scalar>(0.5) && config.forgetting_factor <= Scalar(1)) ||
        config.solve_every < 2 || !not_negative(config.prior_precision) || config.min_samples < 0 ||
        !(config.max_amplification > Scalar(1)) || !(config.max_amplification_least_squares > Scalar(1)) ||
        !(config.gate == Scalar(0) || (config.gate >= Scalar(1) && is_usable(config.gate))) ||
        !not_negative(config.standstill_speed) || !not_negative(config.sign_width)) {
      return Status::kOutOfRange;
    }
    for (const Scalar& weight : config.row_weight) {
      if (!is_usable_weight(weight)) {
        return Status::kOutOfRange;
      }
    }
    bool usable = all_usable(coulomb) && all_usable(viscous);
    for (const auto& link : nominal.links) {
      usable = usable && all_usable(link);
    }
    if (!usable) {
      return Status::kNonFiniteInput;
    }
    config_ = config;
    far_ = config.gate * config.gate;
    nominal_ = nominal;
    write_prior(coulomb, viscous);
    reset();
    configured_ = true;
    return Status::kOk;
  }

  /// Forgets all data and goes back to the nominal parameters.
  void reset() noexcept {
    estimate_ = prior_;
    source_ = EstimateSource::kPrior;
    begin_sums();
    usual_.fill(Scalar(0));
    for (MagnitudeGate<Scalar>& gate : row_gate_) {
      gate.reset();
    }
    for (MagnitudeGate<Scalar>& gate : torque_gate_) {
      gate.reset();
    }
    amplification_ = Scalar(0);
    status_ = Status::kNotExcited;
  }

  /// Takes one sample.
  ///
  /// @param q,qd        positions and velocities, n [rad, rad/s]
  /// @param qdd         measured accelerations, n [rad/s²]
  /// @param instrument  accelerations free of this sample's measurement noise, n [rad/s²]
  /// @param tau         measured torques, n, link side [N·m]
  /// @return kNonFiniteInput (a number of any joint is not finite or beyond kLargestInput): the sample is refused,
  ///         nothing changed; kNotConfigured
  Status update(const Vector& q, const Vector& qd, const Vector& qdd, const Vector& instrument,
                const Vector& tau, Record& record) noexcept {
    return update_motion([&] { return terminal_trigonometry<Arm, First>(q); }, q, qd, qdd, instrument, tau,
                         record);
  }
  /// The same with sines and cosines of q that a controller has computed already.
  Status update(const JointTrigonometry<Arm>& trig, const Vector& q, const Vector& qd, const Vector& qdd,
                const Vector& instrument, const Vector& tau, Record& record) noexcept {
    return update_motion([&] { return terminal_trigonometry<Arm, First>(trig); }, q, qd, qdd, instrument, tau,
                         record);
  }

  /// Takes rows that were computed elsewhere, for instance with the forward pass of the controller.
  /// @param rows,instruments  from the measured acceleration and from the instrument
  Status update_rows(const Rows& rows, const Rows& instruments, const Vector& qd, const Vector& tau,
                     Record& record) noexcept {
    record = Record{};
    record.source = source_;
    if (!configured_) {
      return Status::kNotConfigured;
    }
    std::array<Scalar, kRows> largest;
    if (!all_usable(qd) || !usable(rows, instruments, tau, largest)) {
      return Status::kNonFiniteInput;
    }
    if (config_.standstill_speed > Scalar(0) && stands_still(qd)) {
      record.standstill = true;
    } else {
      ++samples_;
      if (config_.forgetting_factor < Scalar(1)) {
        grow_gain();
      }
      for_rows<Layout>([&](auto row) { judge(row, rows, largest, tau[First + row()], record); });
      take(rows, instruments, tau, record);
    }
    work(record);
    record.source = source_;
    return Status::kOk;
  }

  /// Finishes a solve at once with all data so far, at the cost of a whole solve in one call. For tests, and at
  /// the end of a log.
  Status solve_now() noexcept {
    Record record;
    if (kIsFactored && running_) {
      return Status::kOk;
    }
    begin_solve(config_.use_instruments);
    while (!solver_.advance(kParameters * kParameters)) {
    }
    finish_solve(record);
    return status_;
  }

  /// The estimate in the order of TerminalLayout. Always usable; source() says what it rests on.
  const Row& estimate() const noexcept { return estimate_; }
  EstimateSource source() const noexcept { return source_; }
  /// kOk; kNotExcited or kSingular when the latest solve failed its check and an older estimate is kept.
  Status status() const noexcept { return status_; }
  /// Conditioning of the latest solve, see StagedSolver::amplification.
  Scalar amplification() const noexcept { return amplification_; }
  /// Samples that were used.
  long samples() const noexcept { return samples_; }
  const Row& prior() const noexcept { return prior_; }

  /// The whole arm with the estimate in place of the nominal values of links k..n.
  ///
  /// Exact for rows k..n. Rows before k keep the nominal mass of the terminal link, which these rows cannot see
  /// (README.md, section 6); a payload mass from PayloadEstimator goes in through corrected_for_payload().
  ReducedParameters<Scalar, Description> reduced() const noexcept {
    ReducedParameters<Scalar, Description> all = nominal_;
    for_inertial([&](std::size_t link, std::size_t entry, std::size_t column) {
      all.links[link][entry] = estimate_[column];
    });
    return all;
  }

  /// Estimated Coulomb and viscous friction of joints k..n into vectors of all joints.
  void friction(Vector& coulomb, Vector& viscous) const noexcept {
    for (int r = 0; r < kRows; ++r) {
      const std::size_t column = static_cast<std::size_t>(Layout::friction(r));
      coulomb[First + r] = estimate_[column];
      viscous[First + r] = estimate_[column + 1];
    }
  }

 private:
  static constexpr bool kIsFactored = Form == EstimatorForm::kFactored;
  struct Nothing {};

  template <typename Trigonometry>
  Status update_motion(Trigonometry trigonometry, const Vector& q, const Vector& qd, const Vector& qdd,
                       const Vector& instrument, const Vector& tau, Record& record) noexcept {
    if (configured_ && !(all_usable(q) && all_usable(qdd) && all_usable(instrument))) {
      record = Record{};
      record.source = source_;
      return Status::kNonFiniteInput;
    }
    terminal_rows<Arm, First, 2>(trigonometry(), q, qd, AccelerationPair<Vector>{qdd, instrument},
                                 config_.sign_width, rows_);
    return update_rows(rows_[0], rows_[1], qd, tau, record);
  }

  static std::array<Scalar, kRows> filled(Scalar value) {
    std::array<Scalar, kRows> all{};
    for (Scalar& entry : all) {
      entry = value;
    }
    return all;
  }

  template <typename F>
  static constexpr void for_inertial(F f) noexcept {
    [&]<int... R>(std::integer_sequence<int, R...>) {
      (
          [&] {
            std::size_t column = static_cast<std::size_t>(Layout::inertial(R));
            for (std::size_t entry = 0; entry < 10; ++entry) {
              if (structural::kReducedPattern<Description, First + R>[entry]) {
                f(static_cast<std::size_t>(First + R), entry, column++);
              }
            }
          }(),
          ...);
    }
    (std::make_integer_sequence<int, kRows>{});
  }

  void write_prior(const Vector& coulomb, const Vector& viscous) noexcept {
    for_inertial([&](std::size_t link, std::size_t entry, std::size_t column) {
      prior_[column] = nominal_.links[link][entry];
    });
    for (int r = 0; r < kRows; ++r) {
      const std::size_t column = static_cast<std::size_t>(Layout::friction(r));
      prior_[column] = coulomb[First + r];
      prior_[column + 1] = viscous[First + r];
    }
  }

  // Torques of rows before k are not looked at.
  // largest: entry of each row and its instrument, in magnitude; what far_too_large() wants to know as well
  static bool usable(const Rows& rows, const Rows& instruments, const Vector& tau,
                     std::array<Scalar, kRows>& largest) noexcept {
    bool ok = true;
    for_rows<Layout>([&](auto row) {
      constexpr std::size_t kRow = row();
      LargestMagnitude<Scalar> found;
      for_support<Layout>(row, [&](std::size_t column) {
        found.look(rows[kRow][column]);
        found.look(instruments[kRow][column]);
      });
      largest[kRow] = found.largest();
      ok = ok && is_usable(largest[kRow]) && is_usable(tau[First + row()]);
    });
    return ok;
  }

  bool stands_still(const Vector& qd) const noexcept {
    using std::abs;
    for (int r = 0; r < kRows; ++r) {
      if (abs(qd[First + r]) > config_.standstill_speed) {
        return false;
      }
    }
    return true;
  }

  // Deferred forgetting: new samples weigh more instead of old ones less.
  void grow_gain() noexcept {
    gain_ = gain_ / config_.forgetting_factor;
    if (gain_ > static_cast<Scalar>(1e6)) {
      const Scalar factor = Scalar(1) / gain_;
      gain_ = Scalar(1);
      if constexpr (kIsFactored) {
        if (running_) {  // and the sums are not used any more
          factored_.scale(factor);
          return;
        }
      }
      instrumental_.scale(factor);
      least_squares_.scale(factor);
    }
  }

  template <int R>
  void judge(RowNumber<R> row, const Rows& rows, const std::array<Scalar, kRows>& largest, const Scalar& y,
             Record& record) noexcept {
    constexpr std::size_t i = R;
    if (config_.gate > Scalar(0)) {
      Scalar innovation = y;
      for_support<Layout>(row,
                          [&](std::size_t column) { innovation -= rows[i][column] * estimate_[column]; });
      record.innovation[i] = innovation;
      if (far_too_large(i, largest[i], y) || (source_ != EstimateSource::kPrior && refused(i, innovation))) {
        return;
      }
    }
    record.row_used[i] = true;
  }

  // Rows that were judged fit for use; mostly all of them are, and of weight 1.
  void take(const Rows& rows, const Rows& instruments, const Vector& tau, const Record& record) noexcept {
    std::array<Scalar, kRows> y;
    bool together = config_.use_instruments && !(kIsFactored && running_) && gain_ == Scalar(1);
    for (std::size_t i = 0; i < y.size(); ++i) {
      y[i] = tau[First + static_cast<int>(i)];
      together = together && record.row_used[i] && config_.row_weight[i] == Scalar(1);
    }
    if (!together) {
      for_rows<Layout>([&](auto row) {
        if (record.row_used[row()]) {
          take_row(row, rows[row()], instruments[row()], y[row()]);
        }
      });
      return;
    }
    if (needs_least_squares()) {
      for_rows<Layout>([&](auto row) { least_squares_.add_symmetric(row, rows[row()], y[row()]); });
    }
    instrumental_.add(instruments, rows, y);
  }

  template <int R>
  void take_row(RowNumber<R> row, const Row& w, const Row& instrument, const Scalar& y) noexcept {
    const Scalar weight = config_.row_weight[static_cast<std::size_t>(R)] * gain_;
    if (needs_least_squares()) {
      add_least_squares(row, w, y, weight);
    }
    if (config_.use_instruments || (kIsFactored && running_)) {
      const Row& z = config_.use_instruments ? instrument : w;
      if (weight == Scalar(1)) {  // unweighted rows cost nothing
        add_instrumental(row, z, w, y);
      } else {
        add_instrumental(row, weighted(row, z, weight), w, y);
      }
    }
  }

  template <int R>
  static Row weighted(RowNumber<R> row, const Row& unweighted, const Scalar& weight) noexcept {
    Row z = unweighted;
    for_support<Layout>(row, [&](std::size_t column) { z[column] = z[column] * weight; });
    return z;
  }

  template <int R>
  void add_least_squares(RowNumber<R> row, const Row& w, const Scalar& y, const Scalar& weight) noexcept {
    if (weight == Scalar(1)) {
      least_squares_.add_symmetric(row, w, y);
      return;
    }
    using std::sqrt;
    const Scalar root = sqrt(weight);
    least_squares_.add_symmetric(row, weighted(row, w, root), y * root);
  }

  template <int R>
  void add_instrumental(RowNumber<R> row, const Row& z, const Row& w, const Scalar& y) noexcept {
    if constexpr (kIsFactored) {
      if (running_) {
        if (factored_.add(R, z, w, y) != Status::kOk) {
          collect_afresh();
        }
        return;
      }
    }
    instrumental_.add(row, z, w, y);
  }

  // New sums around the estimate in hand, which stays what it is until they are good.
  void begin_sums() noexcept {
    Row precision;
    precision.fill(config_.prior_precision);
    instrumental_.reset(estimate_, precision);
    least_squares_.reset(estimate_, precision);
    gain_ = Scalar(1);
    samples_ = 0;
    solved_at_ = 0;
    running_ = false;
    solver_.reset();
  }

  // After a lost pivot.
  void collect_afresh() noexcept {
    begin_sums();
    source_ = EstimateSource::kLeastSquares;
    status_ = Status::kSingular;
  }

  // Compares the largest entry of regressor and instrument, and the torque, with those of late. A start with wild
  // numbers is dropped as soon as it shows.
  bool far_too_large(std::size_t i, const Scalar& largest, const Scalar& y) noexcept {
    using std::abs;
    using Verdict = typename MagnitudeGate<Scalar>::Verdict;
    const Verdict row = row_gate_[i].look(largest, far_);
    const Verdict torque = row == Verdict::kRefuse ? row : torque_gate_[i].look(abs(y), far_);
    if ((row == Verdict::kAcceptAfresh || torque == Verdict::kAcceptAfresh) &&
        source_ == EstimateSource::kPrior) {
      begin_sums();
    }
    return torque == Verdict::kRefuse;
  }

  // Least squares runs along with the instruments until these are trusted; alone when there are none.
  bool needs_least_squares() const noexcept {
    return config_.use_instruments ? source_ != EstimateSource::kInstrumental : !(kIsFactored && running_);
  }

  // The usual size of a row's innovation follows its magnitude, slowly and cut at the gate, so that a change that
  // lasts is let in after some tens of samples.
  bool refused(std::size_t r, const Scalar& innovation) noexcept {
    using std::abs;
    const Scalar magnitude = abs(innovation);
    if (!(usual_[r] > Scalar(0))) {
      usual_[r] = magnitude;
      return false;
    }
    const Scalar limit = config_.gate * usual_[r];
    const bool refuse = !(magnitude <= limit);
    usual_[r] += static_cast<Scalar>(0.01) * ((refuse ? limit : magnitude) - usual_[r]);
    return refuse;
  }

  void work(Record& record) noexcept {
    if constexpr (kIsFactored) {
      if (running_) {
        const Row solution = factored_.solution();
        if (all_usable(solution)) {
          estimate_ = solution;
          record.new_estimate = true;
        } else {
          collect_afresh();
        }
        return;
      }
    }
    if (solver_.busy()) {
      constexpr int kTotal = StagedSolver<Scalar, Layout>::total_work();
      if (solver_.advance(kTotal / config_.solve_every + 1)) {
        finish_solve(record);
      }
    }
    if (!solver_.busy() && samples_ >= config_.min_samples && samples_ - solved_at_ >= config_.solve_every) {
      // During start-up the two systems take turns.
      turn_ = !turn_;
      begin_solve(config_.use_instruments && (source_ == EstimateSource::kInstrumental || turn_));
      solved_at_ = samples_;
    }
  }

  void begin_solve(bool instruments) noexcept {
    solving_instruments_ = instruments;
    if (instruments) {
      solver_.start(instrumental_.matrix(), instrumental_.right_side(), false);
    } else {
      solver_.start(least_squares_.matrix(), least_squares_.right_side(), true);
    }
  }

  void finish_solve(Record& record) noexcept {
    status_ = solver_.status();
    if (status_ != Status::kOk) {
      return;
    }
    const Scalar amplification = solver_.amplification();
    const Scalar limit =
        solving_instruments_ ? config_.max_amplification : config_.max_amplification_least_squares;
    if (!(amplification <= limit)) {
      status_ = Status::kNotExcited;
      return;
    }
    amplification_ = amplification;
    estimate_ = solver_.solution();
    record.new_estimate = true;
    source_ = solving_instruments_ ? EstimateSource::kInstrumental : EstimateSource::kLeastSquares;
    if constexpr (kIsFactored) {
      if (solving_instruments_ == config_.use_instruments) {
        hand_over();
      }
    }
  }

  // From accumulated equations to factors, with everything seen up to this sample.
  void hand_over() noexcept requires(kIsFactored) {
    const auto& equations = config_.use_instruments ? instrumental_ : least_squares_;
    running_ =
        factored_.start(equations.matrix(), equations.right_side(), !config_.use_instruments) == Status::kOk;
    if (running_) {
      const Row solution = factored_.solution();
      running_ = all_usable(solution);
      estimate_ = running_ ? solution : estimate_;
    }
  }

  Config config_{};
  ReducedParameters<Scalar, Description> nominal_{};
  Row prior_{}, estimate_{};
  NormalEquations<Scalar, Layout> instrumental_, least_squares_;
  [[no_unique_address]] std::conditional_t<kIsFactored, FactoredEquations<Scalar, Layout, false>, Nothing>
      factored_;
  StagedSolver<Scalar, Layout> solver_;
  std::array<Rows, 2> rows_{};  ///< entries that a row does not reach stay zero
  std::array<Scalar, kRows> usual_{};
  std::array<MagnitudeGate<Scalar>, kRows> row_gate_{}, torque_gate_{};
  Scalar gain_{1}, far_{64}, amplification_{0};
  long samples_{0}, solved_at_{0};
  Status status_{Status::kNotExcited};
  EstimateSource source_{EstimateSource::kPrior};
  bool configured_{false}, running_{false}, solving_instruments_{false}, turn_{false};
};

}  // namespace heft
