/// @file
/// What every controller of an arm looks like: one step a cycle, a torque in any case, and a status.
#pragma once

#include <cstdint>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// What a controller learns in a cycle.
template <typename Scalar_, int N>
struct JointMeasurement {
  using Scalar = Scalar_;
  JointVector<Scalar, N> q = JointVector<Scalar, N>::Zero();   ///< encoder positions [rad, m]
  JointVector<Scalar, N> qd = JointVector<Scalar, N>::Zero();  ///< [rad/s, m/s]
  JointVector<Scalar, N> tau =
      JointVector<Scalar, N>::Zero();  ///< that acted since the cycle before, link side [N·m, N]
  Scalar dt{0};                        ///< since the cycle before, > 0; of the first the nominal one [s]
  std::uint32_t cut{0};  ///< bit i: of the torque of the cycle before, joint i got less than it was sent
};

/// What a controller answers.
template <typename Scalar, int N>
struct ControlStep {
  JointVector<Scalar, N> torque =
      JointVector<Scalar, N>::Zero();  ///< to apply, whatever the status, link side [N·m, N]
  /// kOk; else the sample was refused, and the torque is one to hold the arm with: see ArmController.
  Status status{Status::kOk};
  /// Of the estimator, where the controller has one: its refusal of a sample does not stop the loop.
  Status measurement{Status::kOk};
  std::uint32_t limited{0};  ///< bit i: torque of joint i was cut at its limit
};

/// A controller of N joints, for loops that are written once and controllers that are exchanged, see ControllerSwitch:
///
/// - step() computes the torque of a cycle. A sample that is not finite, or a dt that is not positive, is refused with a
///   status, and the answer is then the torque of the cycle before, which passes into the gravity torque at the last good
///   position with the time constant `hold_time` (a controller without a model keeps the torque).
/// - A torque cut at its limit, by the controller or after it (JointMeasurement::cut), is told to what estimates or adapts, and
///   teaches it nothing.
/// - watch() takes a sample while another controller is in charge, so that estimates are ready when they are needed.
/// - take_over() makes the next torque the one that was applied last; the difference to what this controller wants fades
///   within the time given.
///
/// Nothing allocates, throws or loops without bound.
template <typename C>
concept ArmController = requires(C controller, const typename C::Reference& reference,
                                 const typename C::Measurement& measured, const typename C::Vector& torque,
                                 typename C::Scalar fade_time) {
  requires C::kNumJoints >= 1;
  requires std::is_same_v<decltype(controller.step(reference, measured)), typename C::Step>;
  requires noexcept(controller.step(reference, measured));
  { controller.watch(measured) }
  noexcept;
  { controller.take_over(torque, fade_time) }
  noexcept;
};

/// What the controllers below have in common. Gains are those of PD, in N·m/rad and N·m·s/rad, or those of an acceleration, in
/// 1/s² and 1/s, where a model turns that into a torque.
template <typename Scalar, int N>
struct ControllerConfig {
  using Vector = JointVector<Scalar, N>;
  Vector stiffness = Vector::Constant(Scalar(400));                   ///< Kp ≥ 0
  Vector damping = Vector::Constant(Scalar(40));                      ///< Kd ≥ 0
  Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
  Scalar hold_time{static_cast<Scalar>(0.02)};                        ///< see ArmController, > 0 [s]
  bool friction{true};                           ///< friction of the model is fed forward along the reference
  Scalar sign_width{static_cast<Scalar>(0.02)};  ///< of its Coulomb sign, see velocity_sign, ≥ 0 [rad/s, m/s]
};

namespace detail {

/// What step(), watch() and take_over() do besides the law of a controller, which Derived has:
///
///     Status wanted(reference, measured, cut, tau, step)   // state unchanged unless kOk
///     void see(measured)                                   // of watch(): an estimator's sample
///     bool holds(q, tau)                                   // torque at rest at q; false: none is known
///
/// `measured` of wanted() and see() is finite but for tau, and its dt counts refused cycles in. `cut` are the joints whose torque
/// in the cycle before was not what the law wanted: at a limit, or all of them while another controller's torque fades.
template <typename Derived, typename Scalar_, int N>
class ControllerFrame {
 public:
  using Scalar = Scalar_;
  static constexpr int kNumJoints = N;
  using Vector = JointVector<Scalar, N>;
  using Reference = JointReference<Scalar, N>;
  using Measurement = JointMeasurement<Scalar, N>;
  using Step = ControlStep<Scalar, N>;

  /// One cycle, see ArmController.
  Step step(const Reference& reference, const Measurement& measured) noexcept {
    Step out;
    Measurement sample = measured;
    out.status = !configured_ ? Status::kNotConfigured : take(sample);
    if (out.status == Status::kOk &&
        (!all_usable(reference.q) || !all_usable(reference.qd) || !all_usable(reference.qdd))) {
      out.status = Status::kNonFiniteInput;
    }
    Vector wanted = Vector::Zero();
    if (out.status == Status::kOk) {
      const bool fading = fade_left_ > Scalar(0);
      const std::uint32_t at_limit = limited_ | measured.cut;
      sample.cut = at_limit;
      out.status = derived().wanted(reference, sample, fading ? kAll : at_limit, wanted, out);
    }
    ControlRecord record;
    if (out.status == Status::kOk) {
      out.status = feedback_.limit(faded(wanted, sample.dt), applied_, record);
    }
    if (out.status != Status::kOk) {
      out.torque = hold(measured);
      return out;
    }
    missed_ = Scalar(0);
    limited_ = out.limited = out.limited | record.limited;
    out.torque = applied_;
    return out;
  }

  /// A cycle in which another controller is in charge.
  void watch(const Measurement& measured) noexcept {
    Measurement sample = measured;
    if (configured_ && take(sample) == Status::kOk) {
      missed_ = Scalar(0);
      limited_ = 0;
      derived().see(sample);
    }
  }

  /// The next torque is this one, as far as it is within the limits, and the difference fades along a cubic. A torque that is not
  /// finite is not taken over.
  /// @param fade_time  > 0 [s]; else the torque is free to jump
  void take_over(const Vector& torque, Scalar fade_time) noexcept {
    if (!all_usable(torque)) {
      return;
    }
    applied_ = torque;
    offset_pending_ = fade_time > Scalar(0) && is_usable(fade_time);
    fade_time_ = fade_left_ = offset_pending_ ? fade_time : Scalar(0);
  }

  /// What was applied last [N·m, N].
  const Vector& applied() const noexcept { return applied_; }

 protected:
  using Config = ControllerConfig<Scalar, N>;

  static bool in_range(const Config& config) noexcept {
    JointFeedback<Scalar, N> feedback;
    return all_usable(config.stiffness) && all_usable(config.damping) && config.hold_time > Scalar(0) &&
           is_usable(config.hold_time) && config.sign_width >= Scalar(0) && is_usable(config.sign_width) &&
           feedback.configure({config.stiffness, config.damping, config.torque_limit}) == Status::kOk;
  }

  /// @param config  in range
  void start(const Config& config) noexcept {
    static_cast<void>(feedback_.configure({config.stiffness, config.damping, config.torque_limit}));
    hold_time_ = config.hold_time;
    applied_.setZero();
    offset_.setZero();
    fade_left_ = missed_ = Scalar(0);
    period_ = Scalar(0);
    limited_ = 0;
    offset_pending_ = placed_ = false;
    configured_ = true;
  }

  JointFeedback<Scalar, N> feedback_;

 private:
  static constexpr std::uint32_t kAll = std::numeric_limits<std::uint32_t>::max();

  Derived& derived() noexcept { return static_cast<Derived&>(*this); }

  /// Checks a sample, and counts the time of refused ones in.
  Status take(Measurement& sample) noexcept {
    const Status of_time = check_step(sample.dt);
    const bool timed = of_time == Status::kOk;
    period_ = timed ? sample.dt : period_;
    if (all_usable(sample.q)) {
      last_q_ = sample.q;
      placed_ = true;
    }
    const Status status = !timed                                          ? of_time
                          : all_usable(sample.q) && all_usable(sample.qd) ? Status::kOk
                                                                          : Status::kNonFiniteInput;
    const Scalar sum = missed_ + (timed ? sample.dt : period_);
    missed_ = sum < static_cast<Scalar>(kLongestStep) ? sum : static_cast<Scalar>(kLongestStep);
    sample.dt = missed_;
    return status;
  }

  /// What the law wants and what is left of the torque before it.
  Vector faded(const Vector& wanted, const Scalar& dt) noexcept {
    if (!(fade_left_ > Scalar(0))) {
      return wanted;
    }
    if (offset_pending_) {
      offset_pending_ = false;
      offset_ = applied_ - wanted;
      return applied_;
    }
    fade_left_ = fade_left_ > dt ? fade_left_ - dt : Scalar(0);
    const Scalar x = fade_left_ / fade_time_;
    return wanted + x * x * (Scalar(3) - Scalar(2) * x) * offset_;
  }

  /// The torque of a refused cycle.
  Vector hold(const Measurement& measured) noexcept {
    Vector at_rest;
    if (!configured_ || !placed_ || !derived().holds(last_q_, at_rest)) {
      return applied_;
    }
    const Scalar dt = measured.dt > Scalar(0) && is_usable(measured.dt) ? measured.dt : period_;
    const Scalar share = dt < hold_time_ ? dt / hold_time_ : Scalar(1);
    ControlRecord record;
    // What is not finite leaves the torque as it is.
    static_cast<void>(feedback_.limit(applied_ + share * (at_rest - applied_), applied_, record));
    return applied_;
  }

  Vector applied_ = Vector::Zero(), offset_ = Vector::Zero(), last_q_ = Vector::Zero();
  Scalar hold_time_{1}, fade_time_{1};
  Scalar fade_left_{0};  ///< of the offset [s]
  Scalar missed_{0};     ///< time of refused cycles since the last good one [s]
  Scalar period_{0};     ///< last dt that was one [s]
  std::uint32_t limited_{0};
  bool offset_pending_{false}, placed_{false}, configured_{false};
};

}  // namespace detail
}  // namespace heft
