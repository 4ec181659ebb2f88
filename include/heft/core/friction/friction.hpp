/// @file
/// Joint friction: Coulomb with a sharp or a smooth sign, viscous, offset.
#pragma once

#include "heft/core/arm_model.hpp"

namespace heft {

/// Sign of a velocity, sharp or smooth.
///
/// @param velocity  [rad/s, m/s]
/// @param width     0: sign with sign(0) = 0. Positive: tanh(velocity / width) by its Padé form
///                  x (27 + x²) / (27 + 9 x²), which reaches ±1 at |x| = 3 with zero slope and is held there;
///                  off from tanh by 0.024 at most, no exponential in the loop
/// @return  within [-1, 1], odd in the velocity; NaN for NaN
template <typename Scalar>
constexpr Scalar velocity_sign(Scalar velocity, Scalar width) noexcept {
  if (!(width > Scalar(0))) {
    return velocity > Scalar(0) ? Scalar(1) : velocity < Scalar(0) ? Scalar(-1) : velocity * Scalar(0);
  }
  const Scalar x = velocity / width;
  if (x >= Scalar(3)) {
    return Scalar(1);
  }
  if (x <= Scalar(-3)) {
    return Scalar(-1);
  }
  const Scalar x2 = x * x;
  const Scalar s = x * (Scalar(27) + x2) / (Scalar(27) + Scalar(9) * x2);
  // Rounding just inside |x| = 3 may step over 1.
  return s > Scalar(1) ? Scalar(1) : s < Scalar(-1) ? Scalar(-1) : s;
}

/// Derivative of velocity_sign by the velocity [s/rad, s/m]: 0 to 1 / width; 0 for a sharp sign.
template <typename Scalar>
constexpr Scalar velocity_sign_slope(Scalar velocity, Scalar width) noexcept {
  if (!(width > Scalar(0))) {
    return Scalar(0);
  }
  const Scalar x2 = (velocity / width) * (velocity / width);
  if (!(x2 < Scalar(9))) {
    return Scalar(0);
  }
  const Scalar ratio = (x2 - Scalar(9)) / (x2 + Scalar(3));
  return ratio * ratio / (Scalar(9) * width);
}

/// Friction torque F sign(q̇) + d q̇ + offset, link side [N·m, N].
/// @param sign_width  as in velocity_sign
template <typename Scalar>
constexpr Scalar friction_torque(const JointActuation<Scalar>& joint, Scalar velocity,
                                 Scalar sign_width) noexcept {
  return joint.coulomb_friction * velocity_sign(velocity, sign_width) + joint.viscous_friction * velocity +
         joint.friction_offset;
}

}  // namespace heft
