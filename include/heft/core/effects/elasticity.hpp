/// @file
/// An elastic joint: spring and damper between motor and link, with play or without.
#pragma once

namespace heft {

/// Motor position θ (what the encoder reads), link position x, both on the link side of the gear, e = θ - x:
///
///   τ = J_m θ̈ + friction(θ̇) + S(e, ė),   S(e, ė) = rigid body(x, ẋ, ẍ),
///   S = K (e - g/2) + D ė above g/2, K (e + g/2) + D ė below -g/2, 0 between, where the flanks of the teeth do not touch.
template <typename Scalar>
struct Elasticity {
  int joint{0};             ///< counted from 0
  Scalar stiffness{0};      ///< K, positive [N·m/rad, N/m]
  Scalar damping{0};        ///< D [N·m·s/rad, N·s/m]
  Scalar motor_inertia{0};  ///< J_m, on the link side of the gear [kg·m², kg]
  Scalar gap{0};            ///< g, play from one flank of the teeth to the other, 0 or more [rad, m]
};

/// Bend of a spring with play: how far e is beyond the flank that it touches, 0 between the flanks [rad, m].
/// @param deflection  e = θ - x
template <typename Scalar>
constexpr Scalar bent(const Scalar& deflection, const Scalar& gap) noexcept {
  const Scalar play = gap / Scalar(2);
  if (deflection > play) return deflection - play;
  if (deflection < -play) return deflection + play;
  return Scalar(0);
}

/// S(e, ė), the torque that spring and damper pass on [N·m, N].
/// @param rate  ė [rad/s, m/s]
template <typename Scalar>
constexpr Scalar spring_torque(const Elasticity<Scalar>& spring, const Scalar& deflection,
                               const Scalar& rate) noexcept {
  const Scalar bend = bent(deflection, spring.gap);
  if (spring.gap > Scalar(0) && bend == Scalar(0)) return Scalar(0);
  return spring.stiffness * bend + spring.damping * rate;
}

}  // namespace heft
