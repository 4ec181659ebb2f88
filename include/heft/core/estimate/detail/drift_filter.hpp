/// @file
/// What the Kalman filters on drifting friction have in common: settings, faults, drift, measurements.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/dynamics/detail/usable_model.hpp"
#include "heft/core/estimate/detail/sample_faults.hpp"
#include "heft/core/estimate/detail/ud_factors.hpp"
#include "heft/core/estimate/drift.hpp"
#include "heft/core/estimate/drifting_arm.hpp"
#include "heft/core/estimate/innovation_gate.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"

namespace heft::detail {

/// What a step makes of the deviations of the state before it, in the rows of q and q̇; those of the parameters stay as they are.
template <typename Scalar, int N, int Load, int Extra>
struct StepColumns {
  static constexpr int kStates = DriftLayout<N, Load>::kStates;
  Eigen::Matrix<Scalar, 2 * N, kStates> of_factors = Eigen::Matrix<Scalar, 2 * N, kStates>::Zero();
  Eigen::Matrix<Scalar, 2 * N, N> of_torque = Eigen::Matrix<Scalar, 2 * N, N>::Zero();
  /// More columns, of variance 1.
  Eigen::Matrix<Scalar, 2 * N, Extra> extra = Eigen::Matrix<Scalar, 2 * N, Extra>::Zero();
  JointVector<Scalar, N> uncertain = JointVector<Scalar, N>::Zero();  ///< friction that is open [N·m, N]
};

/// Kalman filter on [q, q̇, Coulomb, viscous, load] of an arm, P = U D Uᵀ in factors.
///
/// *Drift.* Each parameter is a random walk or relaxes to its nominal value (struct Drift); its variance never exceeds that of
/// the prior, so that what the motion does not show stays bounded however long it takes. Estimates stay within ten prior
/// standard deviations of the nominal value; friction is not negative.
///
/// *Rest.* A joint slower than three sign_width is charged with the part of its Coulomb torque that its velocity leaves open:
/// friction at rest takes up any torque, stays at it, and teaches nothing. A joint at rest does not wear either: its friction, where it
/// is a random walk, keeps its variance.
///
/// *Faults.* Numbers that are not finite and time that does not advance are refused with a status and leave no trace. A measured
/// value off by more than `gate` standard deviations is left out (Record::refused). The mechanical state starts again from
/// the measurement (Record::restarted) after a gap in time, after a position has been refused for longer than `patience`, and
/// after an encoder was frozen; while one is (Record::frozen) nothing is estimated. A torque at its limit is taken as
/// unknown (Record::clipped). Parameters survive all of that.
///
/// Observability. Coulomb and viscous friction of a joint separate when its speed varies; at one constant speed only their sum is
/// determined, and standard_deviation() of each stays near its prior.
///
/// Everything is bounded: one step of dynamics a sample (2 s + 1 of s states for sigma points), no iteration. The object is
/// its own scratch memory: 6 joints in float 9 KiB with derivatives, 10 KiB with sigma points.
template <typename Scalar_, int N, int Load, typename Step>
class DriftFilter {
 public:
  using Scalar = Scalar_;
  using Layout = DriftLayout<N, Load>;
  using Vector = JointVector<Scalar, N>;
  using Model = ArmModel<Scalar, N>;
  static constexpr int kStates = Layout::kStates;
  static constexpr int kCoulomb = Layout::kCoulomb;
  static constexpr int kViscous = Layout::kViscous;
  static constexpr int kLoad = Layout::kLoad;

  using Config = DriftFilterConfig<Scalar, N>;

  /// Treatment of a sample. Bit i of each mask: joint i.
  struct Record {
    Vector position_innovation = Vector::Zero();  ///< q − prediction [rad, m]
    Vector velocity_innovation = Vector::Zero();  ///< q̇ − prediction; zero without velocities [rad/s, m/s]
    std::uint32_t refused{0};                     ///< position left out by the gate
    std::uint32_t refused_velocity{0};            ///< velocity left out by the gate
    std::uint32_t clipped{0};                     ///< torque at its limit, or it was in the last 50 periods
    std::uint32_t frozen{0};  ///< encoder stands although the joint moves: nothing is estimated
    bool restarted{false};    ///< q and q̇ were taken from the measurement
    bool running{false};      ///< the sample was filtered
    /// Normalised innovation squared, mean over the values used; about 1 where noise and model are as configured.
    Scalar surprise{0};
  };

  /// Takes arm and settings; friction starts at the model's values, the load at zero, q and q̇ with the first samples.
  /// @return kOutOfRange (a setting), kNonFiniteInput (the model): state kept
  Status configure(const Config& config, const Model& model) noexcept {
    if (!in_range(config)) {
      return Status::kOutOfRange;
    }
    if (!is_usable_model(model)) {
      return Status::kNonFiniteInput;
    }
    config_ = config;
    arm_.set_model(model, config.sign_width);
    faults_.start(config.period);
    Row variance{};
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      const auto& joint = model.actuation[k];
      nominal_[kCoulomb + k] = joint.coulomb_friction;
      nominal_[kViscous + k] = joint.viscous_friction;
      variance[k] = square(config.position_noise[i]);
      variance[N + k] = square(config.velocity_noise[i]);
      variance[kCoulomb + k] = square(prior_std(config.coulomb.std[i], joint.coulomb_friction));
      variance[kViscous + k] = square(prior_std(config.viscous.std[i], joint.viscous_friction));
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(Load); ++k) {
      variance[kLoad + k] = square(config.load_std[k]);
    }
    ceiling_ = variance;
    P_.set_diagonal(variance);
    x_ = nominal_;
    drift_time_ = Scalar(0);
    stage_ = Stage::kWaits;
    started_ = false;
    configured_ = true;
    return Status::kOk;
  }

  /// Takes one sample with measured velocities.
  /// @param q,qd  measured, n; a velocity that is differenced from q hides a frozen encoder [rad, rad/s; m, m/s on a prismatic
  ///              joint]
  /// @param tau   torque of the drives, n [N·m, N]: less what joint effects take beyond Coulomb and viscous friction; see
  ///              Config::torque_is_held
  /// @param dt    time since the last sample that was not refused, > 0, at most 1e6 [s]; of the first: any
  /// @return kNonFiniteInput, kOutOfRange (dt), kNotPositiveDefinite (links that no arm can have), kNotConfigured: nothing changed
  Status update(const Vector& q, const Vector& qd, const Vector& tau, Scalar dt, Record& record) noexcept {
    return all_usable(qd) ? take(q, &qd, tau, dt, record) : refuse(Status::kNonFiniteInput, record);
  }

  /// The same without velocities.
  Status update(const Vector& q, const Vector& tau, Scalar dt, Record& record) noexcept {
    return take(q, nullptr, tau, dt, record);
  }

  /// Estimates after the last sample.
  Vector position() const noexcept { return part(0); }
  Vector velocity() const noexcept { return part(N); }
  Vector coulomb() const noexcept { return part(kCoulomb); }  ///< [N·m, N]
  Vector viscous() const noexcept { return part(kViscous); }  ///< [N·m·s/rad, N·s/m]
  Scalar coulomb(int joint) const noexcept { return x_[static_cast<std::size_t>(kCoulomb + joint)]; }
  Scalar viscous(int joint) const noexcept { return x_[static_cast<std::size_t>(kViscous + joint)]; }
  /// About the last link frame; what is not estimated is zero.
  InertialParameters<Scalar> load() const noexcept {
    InertialParameters<Scalar> out{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(Load); ++k) {
      out[k] = x_[kLoad + k];
    }
    return out;
  }

  /// Whole state, and its covariance. @param i,j  0 to kStates − 1, see DriftLayout
  const std::array<Scalar, static_cast<std::size_t>(kStates)>& state() const noexcept { return x_; }
  Scalar covariance(int i, int j) const noexcept {
    return P_.covariance(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }
  Scalar standard_deviation(int i) const noexcept {
    using std::sqrt;
    return sqrt(covariance(i, i));
  }
  /// q and q̇ are estimated; false before the first samples and during a fault.
  bool running() const noexcept { return stage_ == Stage::kRuns; }

 private:
  using Row = std::array<Scalar, static_cast<std::size_t>(kStates)>;
  using Mechanics = typename DriftingArm<Scalar, N, Load>::Mechanics;
  static constexpr std::size_t kMoving = static_cast<std::size_t>(2 * N);
  static constexpr int kExtra = Step::kExtra;
  static constexpr int kWidth = 3 * N + kExtra;
  enum class Stage : std::uint8_t { kWaits, kHasPosition, kRuns };

  /// Parameters drift once in so many periods: in float, the drift of one period would be lost in the sum.
  static constexpr int kDriftPeriods = 20;
  /// Prior standard deviations that an estimate may leave its nominal value by.
  static constexpr int kFarthest = 10;
  /// Periods without a sample after which the torque in between is not known.
  static constexpr int kLongestGap = 5;
  /// What is cut off a torque, or taken up by friction at rest, stays the same over some periods, not white: over the square of this
  /// it counts in full.
  static constexpr int kStaysFor = 10;
  /// Share of the nominal value that a standard deviation of 0 stands for, and the least [N·m].
  static constexpr double kPriorShare = 0.5, kLeastPrior = 1e-3;
  /// Most that relaxing takes away at a time, so that factors stay invertible.
  static constexpr double kLeastKept = 1e-3;

  static Scalar square(const Scalar& v) noexcept { return v * v; }
  static Scalar prior_std(const Scalar& set, const Scalar& nominal) noexcept {
    const Scalar share = static_cast<Scalar>(kPriorShare) * (nominal < Scalar(0) ? -nominal : nominal);
    const Scalar least = static_cast<Scalar>(kLeastPrior);
    return set > Scalar(0) ? set : share > least ? share : least;
  }

  static bool in_range(const Config& c) noexcept {
    const auto positive = [](const Scalar& v) { return is_usable(v) && v > Scalar(0); };
    bool good = positive(c.period) && positive(c.sign_width) && positive(c.patience) && c.gate >= Scalar(0) &&
                is_usable(c.gate) && c.gate_widening >= Scalar(0) &&
                c.gate_widening <= static_cast<Scalar>(0.25) && positive(c.coulomb.time) &&
                positive(c.viscous.time) && positive(c.load_time);
    for (int i = 0; i < N; ++i) {
      good = good && is_usable_weight(square(c.position_noise[i])) &&
             is_usable_weight(square(c.velocity_noise[i])) && is_usable_weight(square(c.torque_noise[i])) &&
             c.torque_limit[i] > Scalar(0) && c.coulomb.std[i] >= Scalar(0) && is_usable(c.coulomb.std[i]) &&
             c.viscous.std[i] >= Scalar(0) && is_usable(c.viscous.std[i]);
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(Load); ++k) {
      good = good && is_usable_weight(square(c.load_std[k]));
    }
    return good;
  }

  static Status refuse(Status status, Record& record) noexcept {
    record = Record{};
    return status;
  }

  Vector part(int first) const noexcept {
    Vector out;
    for (int i = 0; i < N; ++i) {
      out[i] = x_[static_cast<std::size_t>(first + i)];
    }
    return out;
  }

  Status take(const Vector& q, const Vector* qd, const Vector& tau, const Scalar& dt,
              Record& record) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!all_usable(q) || !all_usable(tau) || !is_usable(dt)) {
      return Status::kNonFiniteInput;
    }
    if (const Status time = check_step(dt, started_); time != Status::kOk) {
      return time;
    }
    const bool first = !started_;
    SampleFaults<Scalar, N> faults = faults_;
    std::uint32_t frozen = 0;
    if (!first) {
      // A joint at a hard stop stands as a frozen encoder does: a measured velocity tells them apart. That of a filter that waits
      // is none.
      const Vector speed = qd != nullptr ? *qd : running() ? velocity() : Vector(Vector::Zero());
      const Scalar memory = Scalar(1) / (static_cast<Scalar>(kLongestGap) * config_.period);
      const auto found = faults.look(q_, speed, q, speed, tau, config_.torque_limit, dt, memory);
      frozen = found.frozen;
      record.clipped = found.clipped;
    }
    const bool gap = !first && dt > static_cast<Scalar>(kLongestGap) * config_.period;
    if (stage_ == Stage::kRuns && frozen == 0 && !gap) {
      if (const Status status = predict(tau, dt, record.clipped); status != Status::kOk) {
        return refuse(status, record);
      }
      faults_ = faults;
      drift(dt);
      if (stage_ == Stage::kRuns) {
        measure(q, qd, dt, record);
      }
    } else {
      faults_ = faults;
      drift(first ? config_.period : dt);
      stage_ = gap || frozen != 0 || stage_ == Stage::kRuns ? Stage::kWaits : stage_;
      record.frozen = frozen;
      if (frozen == 0) {
        start(q, qd, dt, record);
      }
    }
    started_ = true;
    q_ = q;
    tau_ = tau;
    return Status::kOk;
  }

  // Mechanical state from the measurement; without a velocity from two positions.
  void start(const Vector& q, const Vector* qd, const Scalar& dt, Record& record) noexcept {
    if (qd == nullptr && stage_ == Stage::kWaits) {
      stage_ = Stage::kHasPosition;
      return;
    }
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      const Scalar noise = square(config_.position_noise[i]);
      x_[k] = q[i];
      x_[N + k] = qd != nullptr ? (*qd)[i] : (q[i] - q_[i]) / dt;
      for (std::size_t row : {k, N + k}) {
        for (std::size_t c = row + 1; c < static_cast<std::size_t>(kStates); ++c) {
          P_.upper(row, c) = Scalar(0);
        }
      }
      P_.pivot(k) = noise;
      P_.pivot(N + k) = qd != nullptr ? square(config_.velocity_noise[i]) : Scalar(2) * noise / square(dt);
      position_gate_[k].reset();
      velocity_gate_[k].reset();
      refused_for_[i] = Scalar(0);
    }
    stage_ = Stage::kRuns;
    record.restarted = true;
  }

  // State and covariance after dt. Nothing changes unless kOk.
  Status predict(const Vector& tau, const Scalar& dt, std::uint32_t clipped) noexcept {
    const Vector mean = config_.torque_is_held ? tau_ : Vector(Scalar(0.5) * (tau_ + tau));
    Mechanics change;
    if (const Status status = step_.propagate(arm_, x_, P_, mean, dt, change, columns_);
        status != Status::kOk) {
      return status;
    }
    bool finite = is_finite(columns_.of_factors.sum()) && is_finite(columns_.extra.sum());
    for (int i = 0; i < 2 * N; ++i) {
      finite = finite && is_usable(change[i]);
    }
    if (!finite) {
      stage_ = Stage::kWaits;
      return Status::kOk;
    }
    for (int i = 0; i < 2 * N; ++i) {
      x_[static_cast<std::size_t>(i)] += change[i];
    }
    Vector variance;
    for (int i = 0; i < N; ++i) {
      const bool unknown = (clipped >> i & 1U) != 0;
      variance[i] =
          (square(config_.torque_noise[i]) + square(static_cast<Scalar>(kStaysFor) * columns_.uncertain[i]) +
           (unknown ? square(static_cast<Scalar>(kStaysFor) * config_.torque_limit[i]) : Scalar(0))) *
          (config_.period / dt);
    }
    refactor(variance);
    return Status::kOk;
  }

  // Factors of (A U) D (A U)ᵀ + G variance Gᵀ + E Eᵀ by weighted Gram-Schmidt (C. L. Thornton, 1976; Bierman ch. VI), in the rows of
  // q and q̇ only: below them U is triangular already, so its columns there are the vectors that the method would find.
  void refactor(const Vector& variance) noexcept {
    for (std::size_t i = 0; i < kMoving; ++i) {
      const Eigen::Index row = static_cast<Eigen::Index>(i);
      for (std::size_t k = kMoving; k < static_cast<std::size_t>(kStates); ++k) {
        P_.upper(i, k) = columns_.of_factors(row, static_cast<Eigen::Index>(k));
      }
      for (int k = 0; k < 2 * N; ++k) {
        weight_[k] = P_.pivot(static_cast<std::size_t>(k));
        work_(row, k) = columns_.of_factors(row, k);
      }
      for (int k = 0; k < N; ++k) {
        weight_[2 * N + k] = variance[k];
        work_(row, 2 * N + k) = columns_.of_torque(row, k);
      }
      for (int k = 0; k < kExtra; ++k) {
        weight_[3 * N + k] = Scalar(1);
        work_(row, 3 * N + k) = columns_.extra(row, k);
      }
    }
    for (int j = 2 * N - 1; j >= 0; --j) {
      Scalar d = Scalar(0);
      for (int k = 0; k < kWidth; ++k) {
        weighted_[k] = work_(j, k) * weight_[k];
        d += work_(j, k) * weighted_[k];
      }
      const std::size_t c = static_cast<std::size_t>(j);
      const Scalar floor = ceiling_[c] * static_cast<Scalar>(UdFactors<Scalar, kStates>::kSmallestShare);
      d = d > floor ? d : floor;
      P_.pivot(c) = d;
      const Scalar inverse = Scalar(1) / d;
      for (int i = 0; i < j; ++i) {
        Scalar sum = Scalar(0);
        for (int k = 0; k < kWidth; ++k) {
          sum += work_(i, k) * weighted_[k];
        }
        const Scalar u = sum * inverse;
        P_.upper(static_cast<std::size_t>(i), c) = u;
        for (int k = 0; k < kWidth; ++k) {
          work_(i, k) -= u * work_(j, k);
        }
      }
    }
  }

  // Parameters over some time.
  void drift(const Scalar& dt) noexcept {
    drift_time_ += dt;
    if (drift_time_ < static_cast<Scalar>(kDriftPeriods) * config_.period) {
      return;
    }
    for (std::size_t k = kMoving; k < static_cast<std::size_t>(kStates); ++k) {
      const auto [kind, time] = law(k);
      if (kind == DriftKind::kWanders && k < static_cast<std::size_t>(kLoad) && rests((k - kMoving) % N)) {
        continue;
      }
      const Scalar ceiling = ceiling_[k];
      Scalar gained;
      if (kind == DriftKind::kRelaxes) {
        using std::exp;
        Scalar kept = exp(-drift_time_ / time);
        kept = kept > static_cast<Scalar>(kLeastKept) ? kept : static_cast<Scalar>(kLeastKept);
        x_[k] = nominal_[k] + kept * (x_[k] - nominal_[k]);
        P_.scale_unknown(k, kept);
        gained = ceiling * (Scalar(1) - kept * kept);
      } else {
        const Scalar room = ceiling - P_.covariance(k, k);
        gained = ceiling * drift_time_ / time;
        gained = gained < room ? gained : room;
      }
      if (gained > Scalar(0)) {
        Row unit{};
        unit[k] = Scalar(1);
        P_.add(unit, gained);
      }
    }
    drift_time_ = Scalar(0);
  }

  /// More of its Coulomb torque is open than known.
  bool rests(std::size_t joint) const noexcept {
    return running() && columns_.uncertain[static_cast<int>(joint)] >
                            static_cast<Scalar>(0.5) * x_[static_cast<std::size_t>(kCoulomb) + joint];
  }

  struct Law {
    DriftKind kind;
    Scalar time;
  };
  Law law(std::size_t k) const noexcept {
    if (k < static_cast<std::size_t>(kViscous)) {
      return {config_.coulomb.kind, config_.coulomb.time};
    }
    if (k < static_cast<std::size_t>(kLoad)) {
      return {config_.viscous.kind, config_.viscous.time};
    }
    return {DriftKind::kWanders, config_.load_time};
  }

  void measure(const Vector& q, const Vector* qd, const Scalar& dt, Record& record) noexcept {
    Scalar squares = Scalar(0);
    int used = 0;
    bool lost = false;
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      if (take_value(k, q[i], square(config_.position_noise[i]), position_gate_[k],
                     record.position_innovation[i], squares)) {
        ++used;
        refused_for_[i] = Scalar(0);
      } else {
        record.refused |= std::uint32_t{1} << i;
        refused_for_[i] += dt;
        lost = lost || refused_for_[i] > config_.patience;
      }
    }
    for (int i = 0; qd != nullptr && i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      if (take_value(N + k, (*qd)[i], square(config_.velocity_noise[i]), velocity_gate_[k],
                     record.velocity_innovation[i], squares)) {
        ++used;
      } else {
        record.refused_velocity |= std::uint32_t{1} << i;
      }
    }
    record.surprise = used > 0 ? squares / static_cast<Scalar>(used) : Scalar(0);
    record.running = true;
    keep_in_range();
    if (lost) {
      stage_ = Stage::kWaits;
    }
  }

  // One measured value of state s. false: the gate kept it out.
  bool take_value(std::size_t s, const Scalar& value, const Scalar& noise, InnovationGate<Scalar>& gate,
                  Scalar& innovation, Scalar& squares) noexcept {
    Row f{}, g{};
    f[s] = Scalar(1);
    for (std::size_t j = s + 1; j < static_cast<std::size_t>(kStates); ++j) {
      f[j] = P_.upper(s, j);
    }
    Scalar variance = noise;
    for (std::size_t j = s; j < static_cast<std::size_t>(kStates); ++j) {
      g[j] = P_.pivot(j) * f[j];
      variance += f[j] * g[j];
    }
    innovation = value - x_[s];
    if (!is_finite(variance)) {
      return false;
    }
    const Scalar square_ratio = innovation * innovation / variance;
    if (config_.gate > Scalar(0)) {
      using std::sqrt;
      if (gate.refuses(sqrt(square_ratio), config_.gate, config_.gate_widening)) {
        return false;
      }
    }
    squares += square_ratio;
    const Row gain = P_.reduce(f, g, noise, ceiling_);
    for (std::size_t j = 0; j < static_cast<std::size_t>(kStates); ++j) {
      x_[j] += gain[j] * innovation;
    }
    return true;
  }

  void keep_in_range() noexcept {
    using std::sqrt;
    for (std::size_t k = kMoving; k < static_cast<std::size_t>(kStates); ++k) {
      const Scalar way = static_cast<Scalar>(kFarthest) * sqrt(ceiling_[k]);
      const bool friction = k < static_cast<std::size_t>(kLoad);
      const Scalar low = friction && nominal_[k] - way < Scalar(0) ? Scalar(0) : nominal_[k] - way;
      const Scalar high = nominal_[k] + way;
      x_[k] = x_[k] > high ? high : x_[k] > low ? x_[k] : low;
    }
    for (std::size_t k = 0; k < kMoving; ++k) {
      if (!is_usable(x_[k])) {
        x_[k] = Scalar(0);
        stage_ = Stage::kWaits;
      }
    }
  }

  Config config_{};
  DriftingArm<Scalar, N, Load> arm_;
  Step step_;
  UdFactors<Scalar, kStates> P_;
  Row x_{}, nominal_{}, ceiling_{};
  SampleFaults<Scalar, N> faults_;
  std::array<InnovationGate<Scalar>, static_cast<std::size_t>(N)> position_gate_{}, velocity_gate_{};
  Vector q_ = Vector::Zero(), tau_ = Vector::Zero(), refused_for_ = Vector::Zero();
  Scalar drift_time_{0};
  Stage stage_{Stage::kWaits};
  bool started_{false};  ///< a sample has been taken
  bool configured_{false};
  // Scratch.
  StepColumns<Scalar, N, Load, kExtra> columns_;
  Eigen::Matrix<Scalar, 2 * N, kWidth> work_ = Eigen::Matrix<Scalar, 2 * N, kWidth>::Zero();
  Eigen::Matrix<Scalar, kWidth, 1> weight_ = Eigen::Matrix<Scalar, kWidth, 1>::Zero(),
                                   weighted_ = Eigen::Matrix<Scalar, kWidth, 1>::Zero();
};

}  // namespace heft::detail
