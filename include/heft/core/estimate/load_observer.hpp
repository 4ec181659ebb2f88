/// @file
/// The load of an arm while it moves, sample by sample.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/estimate/detail/change_watch.hpp"
#include "heft/core/estimate/detail/load_batch.hpp"
#include "heft/core/estimate/detail/load_fade.hpp"
#include "heft/core/estimate/detail/load_priors.hpp"
#include "heft/core/estimate/detail/recent_samples.hpp"
#include "heft/core/estimate/detail/residual_noise.hpp"
#include "heft/core/estimate/detail/update_schedule.hpp"
#include "heft/core/estimate/load_estimate.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Estimates the load, sample by sample, and follows it when it changes: filters, residual of the arm without load, recursive
/// least squares (PayloadEstimator), noise learnt from the innovations, change detection, and as its output a body that
/// can exist, for the controller's model:
///
/// @code
/// LoadObserver<app::Ur10e, float> load;                     // a header of `heft export`: the arm without load
/// if (load.configure() != Status::kOk) ...
/// status = load.update(q, qd, tau_measured, dt, record);    // every cycle
/// arm.set_payload(load.load());                             // see ArmTorque
/// @endcode
///
/// Motion comes from encoder positions through the state-variable filter; the torque, less the friction, couplings and
/// effects that the arm without load predicts, passes the same filter and keeps the same delay. Friction is subtracted
/// before the filter because a filtered sign is not the sign of a filtered velocity. A torque that is reported with a sample
/// acted since the sample before: motion is taken half-way.
///
/// After dropouts, jumps of a position and frozen encoders the estimate pauses until the filters have forgotten them. Joints at
/// their torque limit do not count, joints around a reversal or at rest count less. An arm at rest teaches nothing after
/// `longest_rest`: neither does the estimate drift, nor does its certainty grow.
///
/// @tparam Description     as of ArmTorque: the arm without load
/// @tparam FrictionJoints  joints, counted from the last, whose friction may differ from the model, see PayloadEstimator
/// Cost: bench/operation_count prints it. No allocation, no exception, every loop bounded.
template <typename Description, typename Scalar, int FrictionJoints = 1>
class LoadObserver {
  using Source = detail::ArmSource<Description>;

 public:
  static constexpr int kNumJoints = Source::kNumJoints;
  using Vector = JointVector<Scalar, kNumJoints>;
  using Model = ArmModel<Scalar, kNumJoints>;
  using Estimator = PayloadEstimator<Scalar, kNumJoints, FrictionJoints>;

  struct Config {
    int first_row{0};  ///< k − 1: torques of joints k..n are used, 0 to n − 1
    /// Poles of the filter that motion and torque pass, see StateVariableFilter [Hz].
    Scalar filter_hz{20};
    Scalar update_rate{100};  ///< updates of the estimate a second, > 0 [Hz]
    /// Rows taken in one sample, so that no sample is long: an update then begins, takes its rows and is finished in
    /// samples of their own. 0: all in one sample.
    int rows_per_sample{0};
    /// Standard deviation of the mass before anything is known [kg]; 0: a third of the arm's mass.
    Scalar mass_prior{0};
    /// Standard deviation of changes of friction [N·m, N·m·s/rad]; 0: half of the last joint's Coulomb friction.
    Scalar friction_prior{0};
    /// Torque residual's standard deviation, a first guess, n [N·m, N]; 0: from friction and weight.
    Vector noise_std = Vector::Zero();
    bool noise_known{false};  ///< noise_std is no guess: estimates count from the first update on
    Scalar sign_width{static_cast<Scalar>(0.02)};  ///< of the Coulomb sign, see velocity_sign [rad/s, m/s]
    /// Slower than this the sign of friction is not known, > 0 [rad/s, m/s].
    Scalar uncertain_speed{static_cast<Scalar>(0.06)};
    /// Torque readings of this size and above are taken for clipped, n, > 0 [N·m, N].
    Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));
    /// load() goes from one load to the next in this time, ≥ 0 [s].
    Scalar transition_time{static_cast<Scalar>(0.2)};
    /// All joints slower than uncertain_speed for longer than this say nothing new, > 0 [s].
    Scalar longest_rest{5};
    Scalar start_time{0};  ///< age of the run at the first sample, for joints that warm up, 0 to 1e6 [s]
    bool explains{false};  ///< explained() is computed with every sample
  };

  /// Treatment of a sample.
  struct Record {
    LoadState state{LoadState::kUnknown};
    bool due{false};           ///< an update of the estimate was due
    bool estimated{false};     ///< one was finished
    bool changed{false};       ///< the torques showed another load
    bool settling{false};      ///< filters settle after the start, a change, a dropout, a jump: no estimate
    bool at_rest{false};       ///< longer than `longest_rest`: nothing is estimated
    std::uint32_t frozen{0};   ///< bit i: position i stands although its velocity does not: no estimate
    std::uint32_t clipped{0};  ///< bit i: torque i is at its limit, or was, as far as the filter remembers
  };

  /// Takes the described arm; nothing is known of the load.
  /// @return kOutOfRange, kNonFiniteInput: state kept
  Status configure(const Config& config = {}) noexcept requires(Source::kIsStatic) {
    Drive drive;
    if (const Status described = Source::template configure<Scalar>(drive, config.sign_width);
        described != Status::kOk) {
      return described;
    }
    const Status status = start(config, drive, Body::model());
    if (status == Status::kOk) {
      body_ = Body{};
    }
    return status;
  }

  /// The same for an arm known at run time; add() brings the rest.
  Status configure(const Model& model, const Config& config = {}) noexcept requires(!Source::kIsStatic) {
    Drive drive;
    if (const Status given = drive.configure(model.actuation, config.sign_width); given != Status::kOk) {
      return given;
    }
    const Status status = start(config, drive, model);
    if (status == Status::kOk) {
      body_.set_model(model);
    }
    return status;
  }

  /// A joint effect, a gear coupling or an elastic joint more. Before the first sample.
  /// @return see DriveTorque; kNotConfigured; state kept unless kOk
  template <typename Part>
  Status add(const Part& part) noexcept requires(!Source::kIsStatic) {
    return configured_ ? front_.drive.add(part) : Status::kNotConfigured;
  }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept { front_.drive.set_temperature(temperature); }

  /// Replaces gravity, in the base frame [m/s²]: a tilted or moving base.
  /// @return kNonFiniteInput: the old one is kept; kNotConfigured
  Status set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    if (!configured_ || !all_usable(gravity)) {
      return configured_ ? Status::kNonFiniteInput : Status::kNotConfigured;
    }
    body_.set_gravity(gravity);
    return Status::kOk;
  }

  /// Takes one sample.
  /// @param q    encoder positions, n [rad, m]
  /// @param qd   velocities, n, of any source: their sign decides about friction [rad/s, m/s]
  /// @param tau  torques that acted since the sample before, n, link side [N·m, N]
  /// @param dt   since the sample before, refused ones included; of the first sample the nominal one, > 0, at most 1e6 [s]
  /// @param cut  bit i: torque i was cut at a limit, of the drive for instance, and does not count
  /// @return kNonFiniteInput, kOutOfRange (dt not positive or too short for the filter),
  ///         kNotConfigured: the sample is refused and leaves no trace but its time
  Status update(const Vector& q, const Vector& qd, const Vector& tau, Scalar dt, Record& record,
                std::uint32_t cut = 0) noexcept {
    record = Record{};
    record.state = state_;
    explained_.valid = false;
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (const Status time = check_step(dt); time != Status::kOk) {
      return time;
    }
    const Scalar elapsed = missed_ + dt;
    Status status = Status::kNonFiniteInput;
    if (all_usable(q) && all_usable(qd) && all_usable(tau)) {
      if (!front_.started) {
        begin(q, qd, dt);
        return Status::kOk;
      }
      const Recent before = front_;
      const auto memory = front_.drive.memory();
      status = take(q, qd, tau, elapsed, cut, record);
      if (status != Status::kOk) {
        static_cast<Recent&>(front_) = before;
        front_.drive.go_back(memory);
        record = Record{};
        record.state = state_;
      }
    }
    missed_ = status == Status::kOk || !front_.started ? Scalar(0) : elapsed;
    missed_ = missed_ < static_cast<Scalar>(kLongestStep) ? missed_ : static_cast<Scalar>(kLongestStep);
    return status;
  }

  /// The load that a model should carry, about the last link frame: zero until one is known, always a body that can exist. After
  /// a change the old one is carried until the new one is known.
  const InertialParameters<Scalar>& load() const noexcept { return fade_.now(); }

  /// What is known, and how well. Silent (state kUnknown or kChanging) until it means something.
  LoadEstimate<Scalar> estimate() const noexcept {
    LoadEstimate<Scalar> out{estimator_.payload(), {}, {}, state_, since_, {}, {}};
    for (std::size_t i = 0; i < 10; ++i) {
      using std::sqrt;
      const Scalar variance =
          noise_.factor() * estimator_.estimator().covariance(static_cast<int>(i), static_cast<int>(i));
      out.std[i] = sqrt(variance);
      out.excited[i] = variance < static_cast<Scalar>(kExcited) * prior_variance_[i];
    }
    out.add_com(estimator_.estimator(), noise_.factor());
    return out;
  }

  /// What the arm with load() explains of the last torque, for ContactMonitor. Not valid with the first or a refused sample.
  const ExplainedTorque<Scalar, kNumJoints>& explained() const noexcept { return explained_; }

  LoadState state() const noexcept { return state_; }
  /// kOk: a load is known, or that there is none; kNotExcited; kNotConfigured.
  Status status() const noexcept {
    return !configured_                                                ? Status::kNotConfigured
           : state_ == LoadState::kKnown || state_ == LoadState::kNone ? Status::kOk
                                                                       : Status::kNotExcited;
  }
  const LoadChange<Scalar>& last_change() const noexcept { return change_; }
  /// [s since the first sample]
  Scalar time() const noexcept { return clock_.seconds(); }

  /// Something was gripped, or taken in place of what was there, just now: what is known does not hold any more. The model
  /// keeps the load that it carries until the new one is known.
  /// @return kNotConfigured
  Status attach() noexcept { return declare(fade_.goal()); }

  /// The same where the new load is roughly known: the model takes it up at once, and drops it when the torques show another.
  /// @return kNonFiniteInput, kNotPositiveDefinite: nothing is declared; kNotConfigured
  Status attach(const InertialParameters<Scalar>& expected) noexcept {
    const Status status = check_physical(expected);
    return status == Status::kOk ? declare(expected) : status;
  }

  /// The load was put down just now.
  Status detach() noexcept { return declare({}); }

  /// How much wider intervals are than by the recursion's variances: residuals are correlated in time.
  Scalar widening() const noexcept {
    using std::sqrt;
    return sqrt(noise_.factor());
  }

  /// The recursion, for variances of combinations: times widening(), squared.
  const Estimator& estimator() const noexcept { return estimator_; }

 private:
  using Body = detail::RigidArm<Description, Scalar>;
  using Drive = detail::DriveOf<Description, Scalar>;
  using Recursion = typename Estimator::Estimator;
  using Priors = detail::LoadPriors<Scalar, kNumJoints>;
  using Batch = detail::LoadBatch<Scalar, kNumJoints>;
  using Stage = typename Batch::Stage;
  using Noises = detail::ResidualNoises<Scalar, kNumJoints, Estimator::kParameters>;
  /// The filters have forgotten the past after so many time constants: (1 + 10 + 50) e^-10, 0.3 %, are left of a step.
  static constexpr double kSettled = 10;
  static constexpr int kBeforeLearning = 20;  ///< updates before innovations say what the noise is
  static constexpr int kBeforeCarrying = 12;  ///< updates before an estimate is handed out
  /// A parameter is known when its variance is below this share of the prior's: a tenth of its standard deviation.
  static constexpr double kExcited = 0.01;

  /// What a sample changes before anything is estimated; of the drives, the memory of effects.
  using Recent = detail::RecentSamples<Scalar, kNumJoints>;
  struct Front : Recent {
    Drive drive;
  };

  /// All but the rigid bodies.
  Status start(const Config& config, const Drive& drive, const Model& model) noexcept {
    const Priors priors(model, drive.actuation());
    typename Estimator::Config settings;
    if (const Status status = payload_settings(config, priors, settings); status != Status::kOk) {
      return status;
    }
    Recent recent;
    if (recent.motion.configure(config.filter_hz) != Status::kOk ||
        recent.torque.configure(config.filter_hz) != Status::kOk) {
      return Status::kOutOfRange;
    }
    const Scalar omega = static_cast<Scalar>(6.283185307179586) * config.filter_hz;
    for (int i = 0; i < kNumJoints; ++i) {
      const Scalar level = drive.actuation()[static_cast<std::size_t>(i)].coulomb_friction;
      if (!Noises::in_range(settings.noise_std[i], level, config.update_rate, omega)) {
        return Status::kOutOfRange;
      }
    }
    if (const Status status = estimator_.configure(settings); status != Status::kOk) {
      return status;
    }
    // As configured, for starting again: the factors are still diagonal.
    for (int i = 0; i < Estimator::kParameters; ++i) {
      prior_variance_[static_cast<std::size_t>(i)] = estimator_.estimator().variance(i);
    }
    config_ = config;
    omega_ = omega;
    settle_time_ = static_cast<Scalar>(kSettled) / omega_;
    farthest_ = priors.farthest;
    noise_.start(settings.noise_std, config.noise_known, config.update_rate, omega_, kBeforeLearning);
    static_cast<Recent&>(front_) = recent;
    front_.drive = drive;
    batch_ = Batch{};
    fade_.start(config.transition_time);
    watch_ = {};
    change_ = {};
    clock_.reset();
    missed_ = since_ = Scalar(0);
    reset_due_ = change_due_ = ever_known_ = false;
    state_ = LoadState::kUnknown;
    configured_ = true;
    return Status::kOk;
  }

  void begin(const Vector& q, const Vector& qd, const Scalar& dt) noexcept {
    front_.previous_q = q;
    front_.previous_qd = qd;
    front_.started = true;
    front_.settling = Scalar(2) * settle_time_;
    front_.faults.start(dt);
    schedule_ = detail::update_schedule(Scalar(1) / (dt * config_.update_rate),
                                        kNumJoints - config_.first_row, config_.rows_per_sample);
    front_.until_update = schedule_.every;
  }

  Status take(const Vector& q, const Vector& qd, const Vector& tau, const Scalar& elapsed, std::uint32_t cut,
              Record& record) noexcept {
    Front& f = front_;
    const typename detail::SampleFaults<Scalar, kNumJoints>::Found faults =
        f.faults.look(f.previous_q, f.previous_qd, q, qd, tau, config_.torque_limit, elapsed, omega_, cut);
    const Vector before_q = f.previous_q;
    const Vector middle_q = static_cast<Scalar>(0.5) * (q + before_q);
    const Vector middle_qd = static_cast<Scalar>(0.5) * (qd + f.previous_qd);
    f.previous_q = q;
    f.previous_qd = qd;
    const Scalar forget = f.forgetting(elapsed * omega_ / Scalar(3));
    const bool slow = f.doubt.look(middle_qd, q - before_q, config_.uncertain_speed, forget);
    f.rest = slow ? f.rest + elapsed : Scalar(0);
    f.rest = f.rest < config_.longest_rest + elapsed ? f.rest : config_.longest_rest + elapsed;
    const Scalar left = f.settling - elapsed;
    f.settling = faults.disturbed ? Scalar(2) * settle_time_ : left > Scalar(0) ? left : Scalar(0);
    // Between two samples a joint moves at their difference: that has no delay, where the given velocity has that of its
    // low-pass. Viscous friction takes it; what passes the filter is then the filtered motion's own.
    const Vector slope = (q - before_q) * (Scalar(1) / elapsed);
    if (const Status status = filter(middle_q, middle_qd, slope, tau, elapsed); status != Status::kOk) {
      return status;
    }
    record.frozen = faults.frozen;
    record.clipped = faults.clipped;
    record.at_rest = f.rest > config_.longest_rest;
    if (--f.until_update <= 0) {
      f.until_update = schedule_.every;
      record.due = true;
      if (!(f.settling > Scalar(0)) && !record.at_rest && record.frozen == 0) {
        if (const Status status = begin_batch(faults.clipped); status != Status::kOk) {
          return status;
        }
      }
    }
    // From here on nothing is refused.
    explained_.valid = config_.explains;
    clock_.advance(elapsed);
    go_on(record);
    fade_.advance(elapsed);
    record.settling = front_.settling > Scalar(0) || reset_due_;
    record.state = state_;
    return Status::kOk;
  }

  /// Torque of the rigid bodies alone, and the motion, through the same filter.
  Status filter(const Vector& q, const Vector& qd, const Vector& slope, const Vector& tau,
                const Scalar& elapsed) noexcept {
    Front& f = front_;
    Vector known = Vector::Zero();
    f.drive.add_friction(qd, known);
    for (int i = 0; i < kNumJoints; ++i) {
      known[i] += f.drive.actuation()[static_cast<std::size_t>(i)].viscous_friction * (slope[i] - qd[i]);
    }
    const Vector without_friction = tau - known;
    Vector load;
    if (config_.explains) {
      const Vector acceleration = Scalar(2) / elapsed * (f.previous_qd - qd);  // from half-way to now
      body_.bias_and_loaded(q, qd, acceleration, fade_.now(), load, explained_.torque);
      f.drive.add_inertia(acceleration, explained_.torque);
      explained_.qd = qd;
      explained_.period = elapsed;
      explained_.torque += known;
    } else if (f.drive.has_effects()) {
      body_.bias(q, qd, load);
    }
    known.setZero();
    if (f.drive.has_effects()) {
      RunClock<Scalar> age = clock_;
      age.advance(config_.start_time);
      age.advance(elapsed);
      if (const Status status = f.drive.add_effects(age.seconds(), q, qd, load, known);
          status != Status::kOk) {
        return status;
      }
      explained_.torque += known;
    }
    if (const Status status = f.motion.update(q, elapsed); status != Status::kOk) {
      return status;
    }
    return f.torque.update(without_friction - known, elapsed);
  }

  /// Rows of this instant. Refused where one of them would be, so that none is taken alone.
  Status begin_batch(std::uint32_t clipped) noexcept {
    Batch& b = batch_;
    b.stage = Stage::kIdle;
    const Vector& q = front_.motion.value();
    const Vector& qdd = front_.motion.second_derivative();
    b.qd = front_.motion.derivative();
    Vector known;
    body_.torque_and_columns(q, b.qd, qdd, known, b.columns);
    b.residual = front_.torque.value() - known;
    known.setZero();
    front_.drive.add_inertia(qdd, known);
    b.residual -= known;
    for (int i = config_.first_row; i < kNumJoints; ++i) {
      const std::size_t at = static_cast<std::size_t>(i);
      b.doubt[i] = front_.doubt.variance(i, front_.drive.actuation()[at].coulomb_friction);
      b.left_out[at] = ((clipped >> i) & 1U) != 0;
      if (!is_usable(b.residual[i])) {
        return Status::kNonFiniteInput;
      }
    }
    b.stage = Stage::kBegun;
    b.next = config_.first_row;
    b.rows = 0;
    b.ratio = b.unexplained = b.whole = Scalar(0);
    return Status::kOk;
  }

  /// The filters hold the new load only from here on. Nothing is known of it; the model keeps the old one until
  /// something is.
  void forget_load() noexcept {
    static_cast<void>(estimator_.estimator().configure({}, {}, prior_variance_));
    reset_due_ = false;
    watch_.restart();
    noise_.restart(kBeforeLearning);
    since_ = clock_.seconds();
  }

  /// The next stage of an update: it has begun, takes rows, is finished.
  void go_on(Record& record) noexcept {
    Batch& b = batch_;
    if (change_due_) {
      restart(false);
    }
    if (b.stage == Stage::kBegun) {
      b.stage = Stage::kLearn;
      if (!schedule_.at_once) {
        return;
      }
    }
    if (b.stage == Stage::kLearn) {
      b.stage = Stage::kRows;
      // What the update before left of the noise.
      if (reset_due_ || noise_.end_update(estimator_.estimator().solution())) {
        forget_load();
      }
      if (!schedule_.at_once) {
        return;
      }
    }
    if (b.stage == Stage::kRows) {
      for (int left = schedule_.at_once ? kNumJoints : schedule_.rows_a_sample;
           left > 0 && b.next < kNumJoints; --left) {
        take_row();
      }
      if (b.next < kNumJoints) {
        return;
      }
      b.stage = b.rows > 0 ? Stage::kFinish : Stage::kIdle;
      if (!schedule_.at_once) {
        return;
      }
    }
    if (b.stage == Stage::kFinish) {
      b.stage = Stage::kIdle;
      finish(record);
    }
  }

  void take_row() noexcept {
    Batch& b = batch_;
    const int i = b.next++;
    const std::size_t at = static_cast<std::size_t>(i);
    if (b.left_out[at]) {
      return;
    }
    typename Recursion::Record taken;
    const typename Estimator::Row row = estimator_.load_row(b.columns, b.qd, i);
    const Scalar weight = noise_.weight(i, b.doubt[i]), scatter = noise_.scatter(i, b.doubt[i]);
    if (estimator_.estimator().update(row, b.residual[i], weight, taken) != Status::kOk) {
      return;  // unchanged; cannot be, by the checks of begin_batch and start
    }
    ++b.rows;
    const Scalar squared = taken.innovation * taken.innovation;
    const Scalar information = noise_.factor() * (taken.innovation_variance - weight);
    b.unexplained += squared / scatter;
    b.whole += b.residual[i] * b.residual[i] / scatter;
    const Scalar ratio = squared / (scatter + information);
    const auto most = static_cast<Scalar>(detail::ChangeWatch<Scalar>::kLargestRatio);
    b.ratio += ratio < most ? ratio : most;
    const bool learns = noise_.certain(i, b.doubt[i]) && watch_.updates() >= kBeforeLearning;
    if (learns && (watch_.calm() || !noise_.known(i))) {
      noise_.learn(i, row, b.residual[i], taken.innovation, information);
    }
  }

  void finish(Record& record) noexcept {
    const Batch& b = batch_;
    record.estimated = true;
    const bool changed = watch_.look(b.ratio / static_cast<Scalar>(b.rows), b.unexplained, b.whole);
    if (noise_.learnt()) {
      carry();
      record.changed = change_due_ = changed;
      if (changed && schedule_.at_once) {
        restart(false);
      }
    }
  }

  /// Hands the estimate to the model, gradually, once enough samples have gone into it; a load whose mass cannot be
  /// distinguished from zero is none.
  void carry() noexcept {
    if (watch_.updates() < kBeforeCarrying) {
      state_ = ever_known_ ? LoadState::kChanging : LoadState::kUnknown;
      return;
    }
    InertialParameters<Scalar> load = estimator_.payload();
    using std::sqrt;
    const Scalar variance = noise_.factor() * estimator_.estimator().covariance(kMass, kMass);
    const bool weighs = !(load[kMass] < Scalar(4) * sqrt(variance));
    const bool explained = watch_.explained();
    state_ = weighs ? (explained ? LoadState::kKnown : LoadState::kUnexplained)
             : variance < static_cast<Scalar>(kExcited) * prior_variance_[kMass] ? LoadState::kNone
             : ever_known_                                                       ? LoadState::kChanging
                                                                                 : LoadState::kUnknown;
    ever_known_ = ever_known_ || state_ == LoadState::kKnown || state_ == LoadState::kNone;
    if (state_ == LoadState::kChanging) {
      return;  // the load before, or the declared one, is carried on
    }
    if (!weighs || !explained || make_physical(load, farthest_) != Status::kOk) {
      load = {};
    }
    fade_.approach(load);
  }

  /// Another load from now on.
  void restart(bool declared) noexcept {
    change_due_ = false;
    batch_.stage = Stage::kIdle;  // its rows are of the load before
    change_.any = true;
    change_.declared = declared;
    change_.time = clock_.seconds();
    change_.before = estimate();
    front_.settling = front_.settling > settle_time_ ? front_.settling : settle_time_;
    reset_due_ = true;
    fade_.hold();
    state_ = LoadState::kChanging;
  }

  Status declare(const InertialParameters<Scalar>& now) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    restart(true);
    fade_.go_to(now);
    return Status::kOk;
  }

  Config config_{};
  Body body_;
  Front front_;
  Estimator estimator_;
  typename Estimator::Row prior_variance_{};
  Noises noise_;
  Batch batch_;
  detail::LoadFade<Scalar> fade_;
  detail::ChangeWatch<Scalar> watch_;
  LoadChange<Scalar> change_{};
  ExplainedTorque<Scalar, kNumJoints> explained_;
  RunClock<Scalar> clock_;
  Scalar omega_{1}, settle_time_{0}, farthest_{static_cast<Scalar>(0.5)};
  Scalar missed_{0};  ///< time of refused samples since the last taken one [s]
  Scalar since_{0};   ///< data count from here on [s]
  detail::UpdateSchedule schedule_;
  LoadState state_{LoadState::kUnknown};
  bool configured_{false}, reset_due_{false}, change_due_{false}, ever_known_{false};
};

}  // namespace heft
