/// @file
/// What a model holds beyond rigid bodies, along a reference: friction, couplings, effects, and motors of elastic joints.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/effects/elasticity.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Feed-forward of computed torque. Friction, gear couplings and joint effects act along the reference, so that noise of
/// the measured velocity does not chatter through their signs. Encoders of an elastic joint sit on its motor, which has to be
/// where the reference's torque bends the joint to: θ = x + τ/K.
template <typename Description, typename Scalar>
class ReferenceDrive {
  using Source = detail::ArmSource<Description>;

 public:
  static constexpr int kNumJoints = Source::kNumJoints;
  using Vector = JointVector<Scalar, kNumJoints>;
  using Body = detail::RigidArm<Description, Scalar>;
  using Reference = JointReference<Scalar, kNumJoints>;
  using Actuation = std::array<JointActuation<Scalar>, static_cast<std::size_t>(kNumJoints)>;

  /// @param nominal   the arm without load
  /// @param friction  false leaves out declared friction, and with it what scales it
  /// @return kOutOfRange (sign_width), kNonFiniteInput: state kept
  Status configure(const ArmModel<Scalar, kNumJoints>& nominal, bool friction, Scalar sign_width) noexcept {
    Drive drive;
    Elasticities elasticities{};
    int num_elasticities = 0;
    auto actuation = nominal.actuation;
    if (!friction) {
      for (JointActuation<Scalar>& joint : actuation) {
        joint = {joint.rotor_inertia, Scalar(0), Scalar(0), Scalar(0)};
      }
    }
    if (const Status status = drive.configure(actuation, sign_width); status != Status::kOk) {
      return status;
    }
    if constexpr (Source::kIsStatic) {
      if (const Status status = Source::template add_parts<Scalar>(drive); status != Status::kOk) {
        return status;
      }
      if constexpr (requires { Description::kElasticities; }) {
        static_assert(Description::kElasticities.size() <= static_cast<std::size_t>(kNumJoints));
        static constexpr auto kAll = converted_all<Scalar>(Description::kElasticities);
        for (const Elasticity<Scalar>& elasticity : kAll) {
          elasticities[static_cast<std::size_t>(num_elasticities++)] = elasticity;
        }
      }
    }
    if constexpr (Source::kIsStatic) {
      nominal_ = Body{};  // with the gravity of the description
    } else {
      nominal_.set_model(nominal);
    }
    drive_ = drive;
    elasticities_ = elasticities;
    num_elasticities_ = num_elasticities;
    friction_ = drive.actuation();
    with_friction_ = friction;
    motion_ = {};
    return Status::kOk;
  }

  /// A joint effect, a gear coupling or an elastic joint more.
  /// @return see DriveTorque; state kept unless kOk
  template <typename Part>
  Status add(const Part& part) noexcept {
    if constexpr (std::is_same_v<Part, Elasticity<Scalar>>) {
      if (num_elasticities_ >= kNumJoints || !(part.stiffness > Scalar(0)) || !is_usable(part.stiffness)) {
        return Status::kOutOfRange;
      }
      if (const Status status = drive_.add(part); status != Status::kOk) {
        return status;
      }
      elasticities_[static_cast<std::size_t>(num_elasticities_++)] = part;
      return Status::kOk;
    } else {
      const Status status = drive_.add(part);
      friction_ = drive_.actuation();  // with an offset, if it was one
      return status;
    }
  }

  /// Replaces declared friction, for the feed-forward alone; nothing where friction is left out.
  void set_friction(const Actuation& friction) noexcept { friction_ = with_friction_ ? friction : friction_; }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept { drive_.set_temperature(temperature); }

  /// See ArmTorque::set_gravity; finite.
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept { nominal_.set_gravity(gravity); }

  /// Takes the next point of the reference.
  /// @param arm  with the load that is believed to be there
  /// @param dt   since the point before, > 0 [s]
  /// @return kNonFiniteInput: state kept
  Status update(const Body& arm, const Reference& reference, Scalar dt) noexcept {
    Motion next = motion_;
    next.clock.advance(motion_.started ? dt : Scalar(0));
    next.started = true;
    next.deflection.setZero();
    next.rate.setZero();
    next.torque.setZero();
    if (needed()) {
      Vector load;
      arm.torque(reference.q, reference.qd, reference.qdd, load);
      Vector acceleration = Vector::Zero();
      if (num_elasticities_ > 0) {
        bend(reference, load, dt, next, acceleration);
      }
      const Vector q = reference.q + next.deflection, qd = reference.qd + next.rate,
                   qdd = reference.qdd + acceleration;
      for (int e = 0; e < num_elasticities_; ++e) {
        const int j = elasticities_[static_cast<std::size_t>(e)].joint;
        next.torque[j] += rotor(j) * acceleration[j];
      }
      drive_.add_couplings(qd, qdd, next.torque);
      if (const Status status = drive_.add_effects(next.clock.seconds(), q, qd, load, next.torque);
          status != Status::kOk) {
        return status;
      }
    }
    const Vector velocity = reference.qd + next.rate;
    for (int i = 0; i < kNumJoints; ++i) {
      next.friction[i] =
          friction_torque(friction_[static_cast<std::size_t>(i)], velocity[i], drive_.sign_width());
    }
    next.points += next.points < 2 ? 1 : 0;
    motion_ = next;
    return Status::kOk;
  }

  /// A cycle without a point of the reference: joints warm up all the same, and the next point has none before it that a
  /// difference could be taken to.
  /// @param dt  since the cycle before, > 0 [s]
  void skip(Scalar dt) noexcept {
    motion_.clock.advance(motion_.started ? dt : Scalar(0));
    motion_.started = true;
    motion_.points = 0;
  }

  // Of the last point.
  const Vector& friction() const noexcept { return motion_.friction; }  ///< declared [N·m, N]
  /// Of couplings, effects and the bending of elastic joints [N·m, N].
  const Vector& torque() const noexcept { return motion_.torque; }
  const Vector& deflection() const noexcept { return motion_.deflection; }  ///< motor before link [rad, m]
  const Vector& rate() const noexcept { return motion_.rate; }              ///< its derivative

  /// Reflected inertia of a motor [kg·m², kg].
  const Scalar& rotor(int joint) const noexcept {
    return drive_.actuation()[static_cast<std::size_t>(joint)].rotor_inertia;
  }
  /// More than declared friction and rotors.
  bool needed() const noexcept {
    return drive_.has_effects() || drive_.has_couplings() || num_elasticities_ > 0;
  }

 private:
  using Drive = detail::DriveOf<Description, Scalar>;
  using Elasticities = std::array<Elasticity<Scalar>, static_cast<std::size_t>(kNumJoints)>;

  struct Motion {
    Vector friction = Vector::Zero(), torque = Vector::Zero(), deflection = Vector::Zero(),
           rate = Vector::Zero();
    Vector last_load = Vector::Zero(), last_change = Vector::Zero();
    RunClock<Scalar> clock;
    int points{0};        ///< taken one after the other, up to two
    bool started{false};  ///< the clock runs
  };

  /// An estimated load comes in steps: the derivatives are those of the nominal arm. Play is left out: no motor jumps across
  /// it when the load changes sides.
  void bend(const Reference& reference, const Vector& load, const Scalar& dt, Motion& next,
            Vector& acceleration) const noexcept {
    Vector steady;
    nominal_.torque(reference.q, reference.qd, reference.qdd, steady);
    const Vector none = Vector::Zero();
    const Vector change = motion_.points > 0 ? Vector((steady - motion_.last_load) / dt) : none;
    const Vector change_of_change = motion_.points > 1 ? Vector((change - motion_.last_change) / dt) : none;
    next.last_load = steady;
    next.last_change = change;
    for (int e = 0; e < num_elasticities_; ++e) {
      const Elasticity<Scalar>& elasticity = elasticities_[static_cast<std::size_t>(e)];
      const int j = elasticity.joint;
      next.deflection[j] = load[j] / elasticity.stiffness;
      next.rate[j] = change[j] / elasticity.stiffness;
      acceleration[j] = change_of_change[j] / elasticity.stiffness;
    }
  }

  Body nominal_;
  Drive drive_;
  Elasticities elasticities_{};
  Actuation friction_{};
  int num_elasticities_{0};
  bool with_friction_{true};
  Motion motion_;
};

}  // namespace heft
