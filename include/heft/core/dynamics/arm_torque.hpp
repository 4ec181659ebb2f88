/// @file
/// The whole joint torque of an arm as `heft export` writes it: links, payload, rotors, friction, couplings, joint effects.
#pragma once

#include <array>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/inertia.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// τ = M(q) q̈ + h(q, q̇) + rotors + friction(q̇) + gear couplings + joint effects, with a payload on the last link and gravity
/// from any direction, both changeable at run time:
///
/// @code
/// ArmTorque<app::Ur10e, float> arm;                       // a header of `heft export`
/// if (arm.configure() != Status::kOk) ...
/// status = arm.update(dt, q_ref, qd_ref, qdd_ref, tau);   // every cycle, along the reference
/// @endcode
///
/// Call update() once a cycle and in order: some effects have a memory that goes on from call to call. Along a reference it is
/// feed-forward; along a measured motion, the torque that the model predicts. The motor of an elastic joint counts with its
/// inertia, as if the joint were rigid; a delay of the torque channel is not applied.
///
/// @tparam Description  a header of `heft export`, or any type with `kModel`; RunTimeArm<N, ...> for an arm that is known at run
///                      time only
///
/// Cost, arm of Kawasaki and Nishimura: bench/operation_count prints it. No allocation, no exception, every loop bounded.
template <typename Description, typename Scalar>
class ArmTorque {
  using Source = detail::ArmSource<Description>;

 public:
  static constexpr int kNumJoints = Source::kNumJoints;
  using Vector = JointVector<Scalar, kNumJoints>;
  using Model = ArmModel<Scalar, kNumJoints>;

  struct Config {
    /// Of the Coulomb sign, see velocity_sign, ≥ 0 [rad/s, m/s].
    Scalar sign_width{static_cast<Scalar>(0.02)};
    /// Age of the run at the first update: joints that warm up have been moving for so long, 0 to 1e6 [s].
    Scalar start_time{0};
  };

  /// Takes the described arm: no payload, its own gravity, no memory.
  /// @return kOutOfRange, kNonFiniteInput (settings, or numbers of the description): state kept
  /// Not inlined: the drive that it makes first is not to be on the stack of a caller that configures more.
  [[gnu::noinline]] Status configure(const Config& config = {}) noexcept requires(Source::kIsStatic) {
    Drive drive;
    if (const Status described = Source::template configure<Scalar>(drive, config.sign_width);
        described != Status::kOk) {
      return described;
    }
    const Status status = start(config, drive);
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
    const Status status = start(config, drive);
    if (status == Status::kOk) {
      body_.set_model(model);
    }
    return status;
  }

  /// A joint effect, a gear coupling or an elastic joint more.
  /// @return see DriveTorque; kNotConfigured; state kept unless kOk
  template <typename Part>
  Status add(const Part& part) noexcept requires(!Source::kIsStatic) {
    return configured_ ? drive_.add(part) : Status::kNotConfigured;
  }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept { drive_.set_temperature(temperature); }

  /// Replaces the payload.
  /// @param payload  ten inertial parameters about the last link frame, as LoadObserver::load() gives them; all zero: none
  /// @return kNonFiniteInput, kNotPositiveDefinite (no body has these): the old payload is kept; kNotConfigured
  /// Cost: some 20 multiplications a joint and check_physical; with run-time geometry 100 a joint.
  Status set_payload(const InertialParameters<Scalar>& payload) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (const Status status = check_physical(payload); status != Status::kOk) {
      return status;
    }
    payload_ = payload;
    body_.set_payload(payload);
    return Status::kOk;
  }

  /// The same as a data sheet gives it, at the flange.
  /// @param mass     ≥ 0 [kg]
  /// @param com      centre of mass in the flange frame (kTipPosition, kTipRotation of the description; without them the last
  ///                 link frame) [m]
  /// @param inertia  about the centre of mass, flange axes, [Ixx, Ixy, Iyy, Ixz, Iyz, Izz] [kg·m²]
  Status set_payload(Scalar mass, const std::array<Scalar, 3>& com,
                     const std::array<Scalar, 6>& inertia) noexcept {
    const InertialParameters<Scalar> at_flange = make_inertial_parameters(mass, com, inertia);
    if constexpr (requires { Description::kTipPosition, Description::kTipRotation; }) {
      constexpr auto kRotation = converted<Scalar>(Description::kTipRotation);
      constexpr auto kPosition = converted<Scalar>(Description::kTipPosition);
      return set_payload(to_inertial_parameters(moved(to_pseudo_inertia(at_flange), kRotation, kPosition)));
    } else {
      return set_payload(at_flange);
    }
  }

  /// In the last link frame; all zero: none.
  const InertialParameters<Scalar>& payload() const noexcept { return payload_; }

  /// Replaces gravity: a tilted or moving base.
  /// @param gravity  acceleration of free fall, less the base's own acceleration, in the base frame [m/s²]
  /// @return kNonFiniteInput: the old one is kept; kNotConfigured
  Status set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!all_usable(gravity)) {
      return Status::kNonFiniteInput;
    }
    body_.set_gravity(gravity);
    return Status::kOk;
  }

  /// Forgets the motion: memory and age of the run as after configure().
  void reset() noexcept {
    drive_.reset();
    clock_ = start_;
    started_ = false;
  }

  /// The torque at the next point of a motion.
  /// @param dt         since the last point that was taken, > 0; that of the first is not used [s]
  /// @param q,qd,qdd   n [rad, rad/s, rad/s²; m on a prismatic joint]
  /// @param tau        n, of the motors on the link side of the gears, along positive q [N·m, N]
  /// @return kNonFiniteInput, kOutOfRange (dt), kNotConfigured: tau, memory and age unchanged
  Status update(Scalar dt, const Vector& q, const Vector& qd, const Vector& qdd, Vector& tau) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!all_usable(q) || !all_usable(qd) || !all_usable(qdd)) {
      return Status::kNonFiniteInput;
    }
    if (const Status time = check_step(dt, started_); time != Status::kOk) {
      return time;
    }
    RunClock<Scalar> clock = clock_;
    clock.advance(started_ ? dt : Scalar(0));
    Vector rigid;
    body_.torque(q, qd, qdd, rigid);
    Vector sum = rigid;
    drive_.add_inertia(qdd, sum);
    drive_.add_friction(qd, sum);
    for (int i = 0; i < kNumJoints; ++i) {
      if (!is_finite(sum[i])) {
        return Status::kNonFiniteInput;
      }
    }
    if (drive_.has_effects()) {
      if (const Status status = drive_.add_effects(clock.seconds(), q, qd, rigid, sum);
          status != Status::kOk) {
        return status;
      }
    }
    clock_ = clock;
    started_ = true;
    tau = sum;
    return Status::kOk;
  }

  /// Age of the run [s].
  Scalar time() const noexcept { return clock_.seconds(); }

 private:
  using Body = detail::RigidArm<Description, Scalar>;
  using Drive = detail::DriveOf<Description, Scalar>;

  /// All but the rigid bodies.
  Status start(const Config& config, const Drive& drive) noexcept {
    if (!(config.start_time >= Scalar(0) && config.start_time <= static_cast<Scalar>(kLongestStep))) {
      return Status::kOutOfRange;
    }
    drive_ = drive;
    payload_ = {};
    start_.reset();
    start_.advance(config.start_time);
    reset();
    configured_ = true;
    return Status::kOk;
  }

  Body body_;
  Drive drive_;
  InertialParameters<Scalar> payload_{};
  RunClock<Scalar> start_, clock_;
  bool configured_{false}, started_{false};
};

}  // namespace heft
