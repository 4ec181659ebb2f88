/// @file
/// An elastic joint: spring and damper between motor and link.
#pragma once

namespace heft {

/// Motor position θ (what the encoder reads), link position x, both on the link side of the gear:
///
///   τ = J_m θ̈ + friction(θ̇) + K (θ - x) + D (θ̇ - ẋ),   K (θ - x) + D (θ̇ - ẋ) = rigid body(x, ẋ, ẍ).
template <typename Scalar>
struct Elasticity {
  int joint{0};             ///< counted from 0
  Scalar stiffness{0};      ///< K, positive [N·m/rad, N/m]
  Scalar damping{0};        ///< D [N·m·s/rad, N·s/m]
  Scalar motor_inertia{0};  ///< J_m, on the link side of the gear [kg·m², kg]
};

}  // namespace heft
