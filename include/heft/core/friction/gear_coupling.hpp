/// @file
/// Gears that mix two joints: the motor of one joint turns when another joint moves.
#pragma once

#include "heft/core/friction/friction.hpp"

namespace heft {

/// Motor of joint j ("driven") that turns with q_j + r q_i, as the sixth motor of many wrists does when the
/// fifth joint bends. What this motor feels reaches both joints:
///
///   v = q̇_j + r q̇_i,   T = I_a (q̈_j + r q̈_i) + F_c sign(v) + F_v v,   τ_j += T,   τ_i += r T.
///
/// The parts that depend on one joint alone may be given in that joint's own JointActuation instead.
template <typename Scalar>
struct GearCoupling {
  int driving{0};              ///< joint i, counted from 0
  int driven{0};               ///< joint j, counted from 0
  Scalar ratio{1};             ///< r: turn of the motor, reflected to joint j's side, for one turn of joint i
  Scalar rotor_inertia{0};     ///< I_a, on joint j's side [kg·m²]
  Scalar coulomb_friction{0};  ///< F_c [N·m]
  Scalar viscous_friction{0};  ///< F_v [N·m·s/rad]
};

/// Velocity of the shared motor on joint j's side, q̇_j + r q̇_i; the same for accelerations.
template <typename Scalar>
constexpr Scalar shared_motion(const GearCoupling<Scalar>& coupling, Scalar driving, Scalar driven) noexcept {
  return driven + coupling.ratio * driving;
}

/// Torque T of the shared motor [N·m]: add it to joint j, and r T to joint i.
/// @param velocity      v [rad/s]
/// @param acceleration  q̈_j + r q̈_i [rad/s²]
/// @param sign_width    as in velocity_sign
template <typename Scalar>
constexpr Scalar gear_coupling_torque(const GearCoupling<Scalar>& coupling, Scalar velocity,
                                      Scalar acceleration, Scalar sign_width) noexcept {
  return coupling.rotor_inertia * acceleration +
         coupling.coulomb_friction * velocity_sign(velocity, sign_width) +
         coupling.viscous_friction * velocity;
}

}  // namespace heft
