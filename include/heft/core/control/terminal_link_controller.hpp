/// @file
/// A controller that feels its load: computed torque from the running terminal-link estimate, from encoders and torques alone.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/dynamics/detail/mass_bounds.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/terminal_rows.hpp"
#include "heft/core/estimate/detail/sample_faults.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/filter/aligned_motion.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Computed torque τ = M(q) (q̈_r + Kd ė + Kp e) + h(q, q̇) + rotors + friction(q̇_r) + couplings and effects along the reference,
/// with the parameters of links k..n as TerminalLinkEstimator finds them on the way (Kawasaki and Nishimura, 1984):
///
/// @code
/// TerminalLinkController<app::MyArm, float, 4> controller;                    // rows 5 and 6: k = 5, counted from 0 here
/// if (controller.configure(config) != Status::kOk) ...                        // gains and torque limits
/// status = controller.update(reference, q, tau_measured, dt, tau, record);    // every cycle
/// @endcode
///
/// Velocity for the feedback comes from the encoders by a fast filter; the reference's velocity passes the same filter, so that
/// its delay does not act as an error. Motion, reference and torque for the estimator come by a slow one (AlignedMotion).
///
/// A sample that is bad for the estimator alone (a torque that is not finite, a frozen encoder, a dropout) is left out there,
/// and the torque is computed all the same, with the last estimate. An estimate enters the model only where the
/// mass matrix that it makes lies between `least_inertia` and `most_inertia` times the nominal one, in every direction; else
/// the last good one stays, or the nominal values where that one does not pass at this pose either.
///
/// @tparam Description  a header of `heft export`, or any type with `kModel`
/// @tparam FirstRow     k − 1: first joint whose torque is used
///
/// Cost: bench/operation_count prints it. No allocation, no exception, every loop bounded.
template <typename Description, typename Scalar, int FirstRow>
class TerminalLinkController {
  using Source = detail::ArmSource<Description>;

 public:
  using Arm = StaticArm<Scalar, Description>;
  using Vector = typename Arm::Vector;
  using Estimator = TerminalLinkEstimator<Arm, FirstRow>;
  using Parameters = ReducedParameters<Scalar, Description>;
  static constexpr int kNumJoints = Arm::kNumJoints;
  using Reference = JointReference<Scalar, kNumJoints>;

  struct Config {
    Vector stiffness = Vector::Constant(Scalar(400));                   ///< Kp ≥ 0 [1/s²]
    Vector damping = Vector::Constant(Scalar(40));                      ///< Kd ≥ 0 [1/s]
    Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
    Scalar velocity_hz{100};  ///< poles of the filter for feedback, see StateVariableFilter [Hz]
    Scalar filter_hz{20};     ///< and of the one for the estimator
    Scalar update_rate{200};  ///< samples of the estimator a second, > 0 [Hz]
    Scalar sign_width{static_cast<Scalar>(0.02)};  ///< of the Coulomb sign, see velocity_sign [rad/s, m/s]
    /// Bounds of an estimated mass matrix, as multiples of the nominal one (rotors in both), 0 < least ≤ 1 ≤ most. A
    /// gripped load may be many times as heavy as a small wrist.
    Scalar least_inertia{static_cast<Scalar>(0.1)};
    Scalar most_inertia{100};
    typename Estimator::Config estimator{};
  };

  /// The arm as it is believed to be before anything is estimated.
  struct Nominal {
    Parameters links;
    Vector coulomb, viscous, offset;  ///< friction, n [N·m, N·m·s/rad, N·m]
    Vector rotor;                     ///< reflected inertias, n [kg·m²]
  };

  /// Treatment of a sample.
  struct Record {
    std::uint32_t limited{0};         ///< bit i: torque of joint i was cut at its limit
    Status measurement{Status::kOk};  ///< kOk: taken by the estimator, or passed to its filters; else why not
    EstimateSource source{EstimateSource::kPrior};  ///< of the parameters behind this torque
    bool new_estimate{false};                       ///< the model changed with this sample
    bool estimate_refused{false};                   ///< an estimate came whose mass matrix is out of bounds
    bool settling{false};     ///< after the start, a dropout or a jump the estimator waits
    std::uint32_t frozen{0};  ///< bit i: position i stands although the reference moves on
  };

  /// The description's own values.
  static Nominal described() noexcept {
    Nominal nominal;
    Drive drive;
    static_cast<void>(Source::template configure<Scalar>(drive, Scalar(0)));
    for (std::size_t j = 0; j < kLinks.size(); ++j) {
      nominal.links.links[j] = kLinks[j];
      const JointActuation<Scalar>& joint = drive.actuation()[j];
      const int i = static_cast<int>(j);
      nominal.coulomb[i] = joint.coulomb_friction;
      nominal.viscous[i] = joint.viscous_friction;
      nominal.offset[i] = joint.friction_offset;
      nominal.rotor[i] = joint.rotor_inertia;
    }
    return nominal;
  }

  /// Starts at the description's values, or at others.
  /// @return kOutOfRange, kNonFiniteInput: state kept
  Status configure(const Config& config) noexcept { return configure(config, described()); }
  Status configure(const Config& config, const Nominal& nominal) noexcept {
    const auto positive = [](const Scalar& value) { return value > Scalar(0) && is_usable(value); };
    if (!positive(config.update_rate) || !positive(config.least_inertia) || !positive(config.most_inertia) ||
        config.least_inertia > Scalar(1) || config.most_inertia < Scalar(1) ||
        !all_usable(config.stiffness) || !all_usable(config.damping)) {
      return Status::kOutOfRange;
    }
    if (!all_usable(nominal.offset) || !all_usable(nominal.rotor)) {
      return Status::kNonFiniteInput;
    }
    Loop loop;
    Aligned aligned;
    JointFeedback<Scalar, kNumJoints> feedback;
    if (feedback.configure({config.stiffness, config.damping, config.torque_limit}) != Status::kOk ||
        loop.position.configure(config.velocity_hz) != Status::kOk ||
        loop.reference.configure(config.velocity_hz) != Status::kOk ||
        aligned.configure(config.filter_hz, config.sign_width) != Status::kOk) {
      return Status::kOutOfRange;
    }
    if (const Status status = Source::template configure<Scalar>(loop.drive, config.sign_width);
        status != Status::kOk) {
      return status;
    }
    if (const Status status =
            estimator_.configure(config.estimator, nominal.links, nominal.coulomb, nominal.viscous);
        status != Status::kOk) {
      return status;
    }
    config_ = config;
    nominal_ = nominal;
    feedback_ = feedback;
    loop_ = loop;
    aligned_ = aligned;
    measured_drive_ = loop.drive;
    omega_ = static_cast<Scalar>(6.283185307179586) * config.filter_hz;
    velocity_omega_ = static_cast<Scalar>(6.283185307179586) * config.velocity_hz;
    go_back();
    missed_ = Scalar(0);
    until_update_ = Scalar(0);
    configured_ = true;
    return Status::kOk;
  }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept {
    loop_.drive.set_temperature(temperature);
    measured_drive_.set_temperature(temperature);
  }

  /// One cycle.
  /// @param reference     where the arm is to be; its velocity is that of its position
  /// @param q             encoder positions, n [rad, m]
  /// @param tau_measured  torque that acted since the cycle before, n, link side [N·m, N]
  /// @param dt            since the cycle before, refused ones included; of the first the nominal one, > 0 and at most 1e6 [s]
  /// @param tau           torque to apply, n, link side; unchanged unless kOk
  /// @return kNonFiniteInput (reference, q, dt, or a torque that is not finite), kOutOfRange (dt), kNotConfigured: nothing
  ///         changed but the time; apply the torque of before, or stop. A bad tau_measured is in Record::measurement
  Status update(const Reference& reference, const Vector& q, const Vector& tau_measured, Scalar dt,
                Vector& tau, Record& record) noexcept {
    record = Record{};
    record.source = source_;
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (const Status time = check_step(dt); time != Status::kOk) {
      return time;
    }
    const Scalar elapsed = missed_ + dt;
    const Loop before = loop_;
    Status status = Status::kNonFiniteInput;
    if (all_usable(q) && all_usable(reference.q) && all_usable(reference.qd) && all_usable(reference.qdd)) {
      status = control(reference, q, elapsed, tau, record);
    }
    if (status != Status::kOk) {
      loop_ = before;
      missed_ = loop_.started && elapsed < static_cast<Scalar>(kLongestStep) ? elapsed : Scalar(0);
      return status;
    }
    missed_ = Scalar(0);
    estimate(reference, q, tau_measured, elapsed, record);
    loop_.last_q = q;
    loop_.last_reference = reference.qd;
    loop_.started = true;
    record.source = source_;
    return Status::kOk;
  }

  /// Velocities as the feedback sees them [rad/s, m/s].
  const Vector& velocity() const noexcept { return loop_.velocity; }
  /// The arm behind the present torque.
  const Parameters& arm() const noexcept { return arm_; }
  EstimateSource source() const noexcept { return source_; }
  /// Status of the latest estimate; see TerminalLinkEstimator::status().
  Status status() const noexcept { return configured_ ? estimator_.status() : Status::kNotConfigured; }
  const Estimator& estimator() const noexcept { return estimator_; }
  const FrictionFeedForward<Scalar, kNumJoints>& friction() const noexcept { return friction_; }

  /// Forgets what was estimated and goes back to the nominal arm; the loop goes on.
  void forget() noexcept {
    estimator_.reset();
    go_back();
  }

 private:
  using Filter = StateVariableFilter<Scalar, kNumJoints>;
  using Aligned = AlignedMotion<Scalar, kNumJoints>;
  using Drive = detail::DriveOf<Description, Scalar>;
  using Rows = typename Estimator::Rows;
  using Layout = typename Estimator::Layout;
  using Mass = MassMatrix<Scalar, kNumJoints>;
  /// A fast filter passes a gap in steps of so many time constants at most, up to so many of them.
  static constexpr int kStep = 5, kMostSteps = 64;
  static constexpr int kSettled = 20;  ///< time constants after which the slow filter has forgotten a jump
  static constexpr std::array<PseudoInertia<Scalar>, static_cast<std::size_t>(kNumJoints)> kLinks = [] {
    constexpr auto kReduced = reduced_links(Description::kModel);
    std::array<PseudoInertia<Scalar>, static_cast<std::size_t>(kNumJoints)> out{};
    for (std::size_t j = 0; j < kReduced.size(); ++j) {
      out[j] = converted<Scalar>(kReduced[j]);
    }
    return out;
  }();

  /// What a cycle changes before its torque is known to be good.
  struct Loop {
    Filter position, reference;  ///< of positions, and of the reference's velocity
    Drive drive;                 ///< along the reference
    RunClock<Scalar> clock;
    Vector velocity = Vector::Zero(), last_q = Vector::Zero(), last_reference = Vector::Zero();
    bool started{false};
  };

  void go_back() noexcept {
    arm_ = nominal_.links;
    friction_.coulomb = nominal_.coulomb;
    friction_.viscous = nominal_.viscous;
    friction_.offset = nominal_.offset;
    friction_.sign_width = config_.sign_width;
    source_ = EstimateSource::kPrior;
  }

  Status control(const Reference& reference, const Vector& q, const Scalar& elapsed, Vector& tau,
                 Record& record) noexcept {
    Loop& loop = loop_;
    if (const Status status = differentiate(reference, q, elapsed); status != Status::kOk) {
      return status;
    }
    loop.clock.advance(loop.started ? elapsed : Scalar(0));
    // Velocity error as the filter shows it, on both sides with its delay.
    Vector rate = Vector::Zero();
    if (loop.position.settled()) {
      rate = loop.reference.value() - loop.position.derivative();
    }
    loop.velocity = reference.qd - rate;
    const Vector command = commanded_acceleration<Scalar, kNumJoints>(feedback_, reference, q, loop.velocity);
    Vector wanted;
    inverse_dynamics<Arm>(arm_, joint_trigonometry<Arm>(q), q, loop.velocity, command, wanted);
    const Vector rigid = wanted;
    wanted += nominal_.rotor.cwiseProduct(command) + friction_.torque(reference.qd);
    loop.drive.add_couplings(reference.qd, command, wanted);
    if (loop.drive.has_effects()) {
      if (const Status status =
              loop.drive.add_effects(loop.clock.seconds(), reference.q, reference.qd, rigid, wanted);
          status != Status::kOk) {
        return status;
      }
    }
    ControlRecord limits;
    const Status status = feedback_.limit(wanted, tau, limits);
    record.limited = limits.limited;
    return status;
  }

  /// Advances the fast filters. A gap is passed in steps, so that they do not start again in the middle of a motion.
  Status differentiate(const Reference& reference, const Vector& q, const Scalar& elapsed) noexcept {
    Loop& loop = loop_;
    const Scalar h = elapsed * velocity_omega_;
    int steps = 1;
    if (loop.started && h > Scalar(kStep)) {
      steps = h < Scalar(kStep * kMostSteps) ? static_cast<int>(h / Scalar(kStep)) + 1 : 1;
    }
    for (int k = 1; k <= steps; ++k) {
      const Scalar part = static_cast<Scalar>(k) / static_cast<Scalar>(steps);
      const Scalar step = elapsed / static_cast<Scalar>(steps);
      const Vector position = k == steps ? q : Vector(loop.last_q + part * (q - loop.last_q));
      const Vector velocity = k == steps
                                  ? reference.qd
                                  : Vector(loop.last_reference + part * (reference.qd - loop.last_reference));
      if (const Status status = loop.position.update(position, step); status != Status::kOk) {
        return status;
      }
      if (const Status status = loop.reference.update(velocity, step); status != Status::kOk) {
        return status;
      }
    }
    return Status::kOk;
  }

  /// The estimator's half of a cycle; nothing in it can stop the other one.
  void estimate(const Reference& reference, const Vector& q, const Vector& tau, const Scalar& elapsed,
                Record& record) noexcept {
    if (!all_usable(tau)) {
      record.measurement = Status::kNonFiniteInput;
      unseen_ = unseen_ + elapsed < static_cast<Scalar>(kLongestStep) ? unseen_ + elapsed : unseen_;
      return;
    }
    const Scalar since = unseen_ + elapsed;
    if (!loop_.started) {
      faults_.start(elapsed);
      settling_ = static_cast<Scalar>(kSettled) / omega_;
    } else {
      // The velocity is made of the positions: against the reference a frozen one shows.
      const auto found = faults_.look(loop_.last_q, loop_.last_reference, q, reference.qd, tau,
                                      config_.torque_limit, since, omega_);
      record.frozen = found.frozen;
      const Scalar left = settling_ - since;
      settling_ = found.disturbed    ? static_cast<Scalar>(kSettled) / omega_
                  : left > Scalar(0) ? left
                                     : Scalar(0);
    }
    record.measurement = aligned_.update(
        q, loop_.velocity, reference.q, tau, since, [this](const Vector& at, const Vector& qd, Vector& left) {
          Vector known = nominal_.offset;
          measured_drive_.add_couplings(qd, Vector::Zero(), known);
          if (measured_drive_.has_effects()) {
            Vector load;
            bias_torque<Arm>(arm_, joint_trigonometry<Arm>(at), at, qd, load);
            if (const Status status = measured_drive_.add_effects(loop_.clock.seconds(), at, qd, load, known);
                status != Status::kOk) {
              return status;
            }
          }
          left -= known;
          return Status::kOk;
        });
    unseen_ = Scalar(0);
    record.settling = settling_ > Scalar(0) || !aligned_.settled();
    until_update_ -= elapsed;
    if (record.measurement == Status::kOk && (record.settling || record.frozen != 0)) {
      record.measurement = Status::kNotExcited;
    }
    // Half a sample early rather than late, so that rounding of sample times does not skip one.
    if (record.measurement != Status::kOk || until_update_ > static_cast<Scalar>(0.5) * elapsed) {
      return;
    }
    until_update_ += Scalar(1) / config_.update_rate;
    until_update_ = until_update_ > Scalar(0) ? until_update_ : Scalar(0);
    take(q, record);
  }

  void take(const Vector& q, Record& record) noexcept {
    Vector net = Vector::Zero();
    measured_drive_.add_couplings(Vector::Zero(), aligned_.qdd(), net);
    net = aligned_.tau() - net - nominal_.rotor.cwiseProduct(aligned_.qdd());
    terminal_rows<Arm, FirstRow, 2>(terminal_trigonometry<Arm, FirstRow>(aligned_.q()), aligned_.q(),
                                    aligned_.qd(), {aligned_.qdd(), aligned_.qdd_ref()}, config_.sign_width,
                                    rows_);
    for (std::size_t r = 0; r < rows_[0].size(); ++r) {
      const std::size_t column = static_cast<std::size_t>(Layout::friction(static_cast<int>(r)));
      rows_[0][r][column] = rows_[1][r][column] = aligned_.sign()[FirstRow + static_cast<int>(r)];
    }
    typename Estimator::Record taken;
    record.measurement = estimator_.update_rows(rows_[0], rows_[1], aligned_.qd(), net, taken);
    if (record.measurement != Status::kOk || !taken.new_estimate) {
      return;
    }
    const Parameters found = estimator_.reduced();
    if (within_bounds(found, q)) {
      arm_ = found;
      estimator_.friction(friction_.coulomb, friction_.viscous);
      source_ = estimator_.source();
      record.new_estimate = true;
      return;
    }
    record.estimate_refused = true;
    if (source_ != EstimateSource::kPrior && !within_bounds(arm_, q)) {
      go_back();
      record.new_estimate = true;
    }
  }

  /// least M₀ < M < most M₀ at this pose, as quadratic forms, with rotors.
  bool within_bounds(const Parameters& parameters, const Vector& q) const noexcept {
    const auto trig = joint_trigonometry<Arm>(q);
    Mass found, nominal;
    mass_matrix<Arm>(parameters, trig, q, found);
    mass_matrix<Arm>(nominal_.links, trig, q, nominal);
    for (int i = 0; i < kNumJoints; ++i) {
      found(i, i) += nominal_.rotor[i];
      nominal(i, i) += nominal_.rotor[i];
    }
    return detail::between<Scalar, kNumJoints>(found, nominal, config_.least_inertia, config_.most_inertia);
  }

  Config config_{};
  Nominal nominal_{};
  JointFeedback<Scalar, kNumJoints> feedback_;
  Loop loop_;
  Aligned aligned_;
  Drive measured_drive_;  ///< along the measured motion
  detail::SampleFaults<Scalar, kNumJoints> faults_;
  Estimator estimator_;
  std::array<Rows, 2> rows_{};  ///< entries that a row does not reach stay zero
  Parameters arm_{};
  FrictionFeedForward<Scalar, kNumJoints> friction_;
  Scalar omega_{1}, velocity_omega_{1};
  Scalar missed_{0};        ///< time of refused cycles since the last taken one [s]
  Scalar unseen_{0};        ///< time of cycles whose torque was bad, since the last good one [s]
  Scalar settling_{0};      ///< left to wait [s]
  Scalar until_update_{0};  ///< of the estimator [s]
  EstimateSource source_{EstimateSource::kPrior};
  bool configured_{false};
};

}  // namespace heft
