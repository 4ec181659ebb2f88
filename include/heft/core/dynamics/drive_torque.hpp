/// @file
/// What motors spend besides moving rigid bodies: rotors, friction, gear couplings, cables, joint effects with their memory.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/arm_model.hpp"
#include "heft/core/effects/cable.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/effects/elasticity.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/friction/gear_coupling.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// The torque of the drives of an arm with N joints, in parts: a torque that comes through a filter needs the friction of the
/// motion before it and the inertia of the motion behind it.
///
/// @tparam kEffects, kCouplings, kCables  room for joint effects, gear couplings and cables
template <typename Scalar, int N, int kEffects, int kCouplings, int kCables = 0>
class DriveTorque {
 public:
  using Vector = JointVector<Scalar, N>;
  using Actuation = std::array<JointActuation<Scalar>, static_cast<std::size_t>(N)>;

  /// Declared rotors and friction; no effects, no couplings, no memory.
  /// @param sign_width  of the Coulomb sign, see velocity_sign, ≥ 0 [rad/s, m/s]
  /// @return kOutOfRange (sign_width), kNonFiniteInput: state kept
  Status configure(const Actuation& actuation, Scalar sign_width) noexcept {
    if (!(sign_width >= Scalar(0)) || !is_usable(sign_width)) {
      return Status::kOutOfRange;
    }
    for (const JointActuation<Scalar>& joint : actuation) {
      if (!is_usable(joint.rotor_inertia) || !is_usable(joint.coulomb_friction) ||
          !is_usable(joint.viscous_friction) || !is_usable(joint.friction_offset)) {
        return Status::kNonFiniteInput;
      }
    }
    actuation_ = actuation;
    sign_width_ = sign_width;
    effects_ = Effects{};
    num_couplings_ = 0;
    num_cables_ = 0;
    return Status::kOk;
  }

  /// One effect more. Rotor inertia and offset have a place in the actuation and are added there.
  /// @return as EffectFeedForward::add; state kept unless kOk
  Status add(const JointEffect<Scalar>& effect) noexcept {
    const bool rotor = effect.kind == joint_effect_kind<RotorInertia>();
    if (!rotor && effect.kind != joint_effect_kind<Offset>()) {
      return effects_.add(effect);
    }
    if (effect.joint < 0 || effect.joint >= N) {
      return Status::kOutOfRange;
    }
    if (!is_usable(effect.parameters[0])) {
      return Status::kNonFiniteInput;
    }
    JointActuation<Scalar>& joint = actuation_[static_cast<std::size_t>(effect.joint)];
    (rotor ? joint.rotor_inertia : joint.friction_offset) += effect.parameters[0];
    return Status::kOk;
  }

  /// One coupling more.
  /// @return kOutOfRange when there is no room, or no two such joints; kNonFiniteInput; state kept
  Status add(const GearCoupling<Scalar>& coupling) noexcept {
    if (num_couplings_ >= kCouplings || !are_two_joints(coupling.driving, coupling.driven)) {
      return Status::kOutOfRange;
    }
    if (!is_usable(coupling.ratio) || !is_usable(coupling.rotor_inertia) ||
        !is_usable(coupling.coulomb_friction) || !is_usable(coupling.viscous_friction)) {
      return Status::kNonFiniteInput;
    }
    couplings_[static_cast<std::size_t>(num_couplings_)] = coupling;
    ++num_couplings_;
    return Status::kOk;
  }

  /// One cable more.
  /// @return kOutOfRange when there is no room, no two such joints, a negative stiffness or an interval that ends before it
  ///         begins; kNonFiniteInput; state kept
  Status add(const JointCable<Scalar>& cable) noexcept {
    if (num_cables_ >= kCables || !are_two_joints(cable.driving, cable.driven) || cable.stiffness < Scalar(0) ||
        !(cable.seen.low <= cable.seen.high)) {
      return Status::kOutOfRange;
    }
    if (!is_usable(cable.ratio) || !is_usable(cable.stiffness) || !is_usable(cable.neutral)) {
      return Status::kNonFiniteInput;
    }
    if constexpr (kCables > 0) {
      cables_[static_cast<std::size_t>(num_cables_)] = cable;
      ++num_cables_;
    }
    return Status::kOk;
  }

  /// The motor of an elastic joint, as if the joint were rigid.
  /// @return kOutOfRange, kNonFiniteInput: state kept
  Status add(const Elasticity<Scalar>& elasticity) noexcept {
    JointEffect<Scalar> motor;
    motor.kind = joint_effect_kind<RotorInertia>();
    motor.joint = elasticity.joint;
    motor.parameters[0] = elasticity.motor_inertia;
    return add(motor);
  }

  /// Anything that add_effects or add_couplings would add.
  bool has_effects() const noexcept { return effects_.count() > 0 || num_cables_ > 0; }
  bool has_couplings() const noexcept { return num_couplings_ > 0; }
  /// Rotors and friction, effects that have a place there included.
  const Actuation& actuation() const noexcept { return actuation_; }
  Scalar sign_width() const noexcept { return sign_width_; }

  /// Temperatures of the joints from now on, n: see EffectFeedForward::set_temperature.
  void set_temperature(const Vector& temperature) noexcept { effects_.set_temperature(temperature); }

  /// Forgets the motion.
  void reset() noexcept { effects_.reset(); }

  /// What the motion has left, for a caller that may have to go back.
  const auto& memory() const noexcept { return effects_.memory(); }
  template <typename Memory>
  void go_back(const Memory& memory) noexcept {
    effects_.go_back(memory);
  }

  /// Declared friction of all joints, and the friction of shared motors, added to tau [N·m, N].
  void add_friction(const Vector& qd, Vector& tau) const noexcept {
    for (int i = 0; i < N; ++i) {
      tau[i] += friction_torque(actuation_[static_cast<std::size_t>(i)], qd[i], sign_width_);
    }
    add_couplings(qd, Vector::Zero(), tau);
  }

  /// Friction and inertia of the motors that turn with two joints, added to tau.
  void add_couplings(const Vector& qd, const Vector& qdd, Vector& tau) const noexcept {
    for (int c = 0; c < num_couplings_; ++c) {
      const GearCoupling<Scalar>& coupling = couplings_[static_cast<std::size_t>(c)];
      const Scalar shared = gear_coupling_torque(
          coupling, shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]),
          shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]), sign_width_);
      tau[coupling.driven] += shared;
      tau[coupling.driving] += coupling.ratio * shared;
    }
  }

  /// Rotors of all joints, shared ones included, added to tau.
  void add_inertia(const Vector& qdd, Vector& tau) const noexcept {
    for (int i = 0; i < N; ++i) {
      tau[i] += actuation_[static_cast<std::size_t>(i)].rotor_inertia * qdd[i];
    }
    for (int c = 0; c < num_couplings_; ++c) {
      const GearCoupling<Scalar>& coupling = couplings_[static_cast<std::size_t>(c)];
      const Scalar shared =
          coupling.rotor_inertia * shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
      tau[coupling.driven] += shared;
      tau[coupling.driving] += coupling.ratio * shared;
    }
  }

  /// Joint effects and cables at the next point of a motion, added to tau. Once a cycle and in order: memory goes on from call
  /// to call.
  /// @param time   since the run, with cold joints, began [s]
  /// @param load   torque of the rigid bodies, n [N·m, N]
  /// @return kNonFiniteInput: tau and memory unchanged
  Status add_effects(Scalar time, const Vector& q, const Vector& qd, const Vector& load,
                     Vector& tau) noexcept {
    // The one effect of the acceleration is in the actuation.
    const Status status =
        effects_.add_torque(time, q, qd, Vector::Zero(), load, actuation_, sign_width_, tau);
    if constexpr (kCables > 0) {
      for (int c = 0; c < num_cables_ && status == Status::kOk; ++c) {
        add_cable(cables_[static_cast<std::size_t>(c)], q, tau);
      }
    }
    return status;
  }

 private:
  static bool are_two_joints(int a, int b) noexcept { return a >= 0 && a < N && b >= 0 && b < N && a != b; }

  using Effects = EffectFeedForward<Scalar, N, (kEffects > 0 ? kEffects : 1)>;

  Actuation actuation_{};
  Effects effects_;
  std::array<GearCoupling<Scalar>, static_cast<std::size_t>(kCouplings > 0 ? kCouplings : 1)> couplings_{};
  std::array<JointCable<Scalar>, static_cast<std::size_t>(kCables)> cables_{};
  int num_couplings_{0}, num_cables_{0};
  Scalar sign_width_{0};
};

}  // namespace heft
