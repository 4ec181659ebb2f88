/// @file
/// Joint-space controllers: position-velocity feedback, with gravity, computed torque.
#pragma once

#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Where the arm is to be.
template <typename Scalar, int N>
struct JointReference {
  JointVector<Scalar, N> q = JointVector<Scalar, N>::Zero();  ///< [rad, m]
  JointVector<Scalar, N> qd = JointVector<Scalar, N>::Zero();
  JointVector<Scalar, N> qdd = JointVector<Scalar, N>::Zero();
};

/// Results of the controller other than the torque.
struct ControlRecord {
  std::uint32_t limited{0};  ///< bit i: torque of joint i was cut at its limit
};

/// Feedback on position and velocity, and torque limits, shared by the controllers below.
template <typename Scalar, int N>
class JointFeedback {
 public:
  using Vector = JointVector<Scalar, N>;

  struct Config {
    Vector stiffness = Vector::Zero();  ///< Kp ≥ 0: [N·m/rad], or [1/s²] for computed torque
    Vector damping = Vector::Zero();    ///< Kd ≥ 0: [N·m·s/rad], or [1/s] for computed torque
    Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    for (int i = 0; i < N; ++i) {
      if (!(config.stiffness[i] >= Scalar(0)) || !(config.damping[i] >= Scalar(0)) ||
          !(config.torque_limit[i] > Scalar(0))) {
        return Status::kOutOfRange;
      }
    }
    config_ = config;
    for (int i = 0; i < N; ++i) {
      config_.torque_limit[i] = finite_limit(config.torque_limit[i]);
    }
    return Status::kOk;
  }

  /// Kp (q_r − q) + Kd (q̇_r − q̇).
  Vector feedback(const JointReference<Scalar, N>& reference, const Vector& q,
                  const Vector& qd) const noexcept {
    return config_.stiffness.cwiseProduct(reference.q - q) + config_.damping.cwiseProduct(reference.qd - qd);
  }

  /// Cuts a torque at the limits. A torque that is not finite is refused: kNonFiniteInput, `tau` unchanged.
  Status limit(const Vector& wanted, Vector& tau, ControlRecord& record) const noexcept {
    // Mostly all torques are within their limits, and finite for that.
    bool within = true;
#pragma GCC unroll 8
    for (int i = 0; i < N; ++i) {
      within = within && is_within(wanted[i], config_.torque_limit[i]);
    }
    if (within) {
      tau = wanted;
      record.limited = 0;
      return Status::kOk;
    }
    for (int i = 0; i < N; ++i) {
      if (!is_finite(wanted[i])) {
        return Status::kNonFiniteInput;
      }
    }
    record.limited = 0;
    for (int i = 0; i < N; ++i) {
      const Scalar bound = config_.torque_limit[i];
      const bool high = wanted[i] > bound;
      const bool low = wanted[i] < -bound;
      tau[i] = high ? bound : low ? -bound : wanted[i];
      record.limited |= high || low ? std::uint32_t{1} << i : std::uint32_t{0};
    }
    return Status::kOk;
  }

 private:
  /// Without infinity, what is within a limit is finite.
  static Scalar finite_limit(const Scalar& limit) noexcept {
    if constexpr (std::numeric_limits<Scalar>::has_infinity) {
      return limit > std::numeric_limits<Scalar>::max() ? std::numeric_limits<Scalar>::max() : limit;
    } else {
      return limit;
    }
  }

  Config config_{};
};

/// Friction feed-forward of all joints.
/// @param velocity  the reference velocity, so that noise of the measured one does not chatter through the sign
template <typename Scalar, int N>
struct FrictionFeedForward {
  JointVector<Scalar, N> coulomb = JointVector<Scalar, N>::Zero();  ///< [N·m]
  JointVector<Scalar, N> viscous = JointVector<Scalar, N>::Zero();  ///< [N·m·s/rad]
  JointVector<Scalar, N> offset = JointVector<Scalar, N>::Zero();   ///< [N·m]
  Scalar sign_width{static_cast<Scalar>(0.01)};                     ///< see velocity_sign [rad/s]

  JointVector<Scalar, N> torque(const JointVector<Scalar, N>& velocity) const noexcept {
    JointVector<Scalar, N> tau;
    for (int i = 0; i < N; ++i) {
      tau[i] = coulomb[i] * velocity_sign(velocity[i], sign_width) + viscous[i] * velocity[i] + offset[i];
    }
    return tau;
  }
};

/// Position-velocity feedback, optionally with gravity: τ = Kp e + Kd ė (+ g(q)).
/// @param parameters  of the arm as it is believed to be, a terminal-link correction included
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline Status
    pd_control(const JointFeedback<typename Arm::Scalar, Arm::kNumJoints>& feedback,
               const Parameters& parameters, bool with_gravity,
               const JointReference<typename Arm::Scalar, Arm::kNumJoints>& reference,
               const typename Arm::Vector& q, const typename Arm::Vector& qd, typename Arm::Vector& tau,
               ControlRecord& record) noexcept {
  typename Arm::Vector wanted = feedback.feedback(reference, q, qd);
  if (with_gravity) {
    typename Arm::Vector gravity;
    gravity_torque<Arm>(parameters, joint_trigonometry<Arm>(q), q, gravity);
    wanted += gravity;
  }
  return feedback.limit(wanted, tau, record);
}

/// The same with run-time geometry; the arm's own parameters are used.
template <typename Scalar, int N>
inline Status pd_control(const JointFeedback<Scalar, N>& feedback, const DynamicArm<Scalar, N>& arm,
                         bool with_gravity, const JointReference<Scalar, N>& reference,
                         const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                         JointVector<Scalar, N>& tau, ControlRecord& record) noexcept {
  JointVector<Scalar, N> wanted = feedback.feedback(reference, q, qd);
  if (with_gravity) {
    JointVector<Scalar, N> gravity;
    gravity_torque(arm, joint_trigonometry<DynamicArm<Scalar, N>>(q), q, gravity);
    wanted += gravity;
  }
  return feedback.limit(wanted, tau, record);
}

/// Acceleration that computed torque asks for: q̈_r + Kd ė + Kp e, with gains in [1/s] and [1/s²].
template <typename Scalar, int N>
inline JointVector<Scalar, N> commanded_acceleration(const JointFeedback<Scalar, N>& feedback,
                                                     const JointReference<Scalar, N>& reference,
                                                     const JointVector<Scalar, N>& q,
                                                     const JointVector<Scalar, N>& qd) noexcept {
  return reference.qdd + feedback.feedback(reference, q, qd);
}

/// Computed torque: τ = M(q) (q̈_r + Kd ė + Kp e) + h(q, q̇) + friction(q̇_r), by one inverse dynamics.
///
/// @param parameters  of the arm as it is believed to be. The terminal link's change, mass included, comes in here:
///                    TerminalLinkEstimator::reduced(), corrected_for_payload(), or both
/// @param friction    feed-forward, zero to leave it out
/// @param rotor       reflected rotor inertias, n, multiplied by the commanded acceleration
/// @param trig        of q; computed here where it is left out
/// @param tau         torque, n; unchanged unless kOk
/// @return kNonFiniteInput
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline Status computed_torque(
    const JointFeedback<typename Arm::Scalar, Arm::kNumJoints>& feedback, const Parameters& parameters,
    const FrictionFeedForward<typename Arm::Scalar, Arm::kNumJoints>& friction,
    const typename Arm::Vector& rotor, const JointReference<typename Arm::Scalar, Arm::kNumJoints>& reference,
    const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q, const typename Arm::Vector& qd,
    typename Arm::Vector& tau, ControlRecord& record) noexcept {
  using Vector = typename Arm::Vector;
  const Vector qdd =
      commanded_acceleration<typename Arm::Scalar, Arm::kNumJoints>(feedback, reference, q, qd);
  Vector wanted;
  inverse_dynamics<Arm>(parameters, trig, q, qd, qdd, wanted);
  wanted += friction.torque(reference.qd) + rotor.cwiseProduct(qdd);
  return feedback.limit(wanted, tau, record);
}
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline Status
    computed_torque(const JointFeedback<typename Arm::Scalar, Arm::kNumJoints>& feedback,
                    const Parameters& parameters,
                    const FrictionFeedForward<typename Arm::Scalar, Arm::kNumJoints>& friction,
                    const typename Arm::Vector& rotor,
                    const JointReference<typename Arm::Scalar, Arm::kNumJoints>& reference,
                    const typename Arm::Vector& q, const typename Arm::Vector& qd, typename Arm::Vector& tau,
                    ControlRecord& record) noexcept {
  return computed_torque<Arm>(feedback, parameters, friction, rotor, reference, joint_trigonometry<Arm>(q), q,
                              qd, tau, record);
}

/// Computed torque with run-time geometry; the arm's own parameters and actuation are used.
template <typename Scalar, int N>
inline Status computed_torque(const JointFeedback<Scalar, N>& feedback, const DynamicArm<Scalar, N>& arm,
                              const FrictionFeedForward<Scalar, N>& friction,
                              const JointReference<Scalar, N>& reference, const JointVector<Scalar, N>& q,
                              const JointVector<Scalar, N>& qd, JointVector<Scalar, N>& tau,
                              ControlRecord& record) noexcept {
  using Vector = JointVector<Scalar, N>;
  const Vector qdd = commanded_acceleration<Scalar, N>(feedback, reference, q, qd);
  Vector wanted = inverse_dynamics(arm, q, qd, qdd);
  const Vector extra = friction.torque(reference.qd);
  for (int i = 0; i < N; ++i) {
    wanted[i] += extra[i] + arm.model().actuation[static_cast<std::size_t>(i)].rotor_inertia * qdd[i];
  }
  return feedback.limit(wanted, tau, record);
}

/// Reduced parameters of an arm that carries a payload on its last link: the payload's parameters are added to the
/// last link's and everything is regrouped down to the base, so that its mass reaches every row.
/// @param payload  ten inertial parameters about the last link frame
/// Cost: about 90 multiplications a joint, when the payload changes.
template <typename Scalar, typename Description>
inline ReducedParameters<Scalar, Description> corrected_for_payload(
    const ReducedParameters<Scalar, Description>& parameters,
    const InertialParameters<Scalar>& payload) noexcept {
  constexpr int kN = Description::kModel.kNumJoints;
  static constexpr ArmModel<Scalar, kN> kGeometry = converted<Scalar>(Description::kModel);
  ReducedParameters<Scalar, Description> corrected = parameters;
  const PseudoInertia<Scalar> added = to_pseudo_inertia(payload);
  auto& last = corrected.links[static_cast<std::size_t>(kN - 1)];
  for (std::size_t i = 0; i < 10; ++i) {
    last[i] += added[i];
  }
  reduce(kGeometry, corrected.links);
  return corrected;
}

}  // namespace heft
