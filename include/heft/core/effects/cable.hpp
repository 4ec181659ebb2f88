/// @file
/// A cable over two joints.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// A cable, a hose or a dress pack that runs over joints i and j and is stretched by x = q_j + r q_i:
///
///   T = k (x - x_0),   τ_j += T,   τ_i += r T   (the gradient of k (x - x_0)²/2).
///
/// Beyond the stretch that it was seen at, T stays that of the border.
template <typename Scalar>
struct JointCable {
  int driving{0};                ///< joint i, counted from 0
  int driven{0};                 ///< joint j, counted from 0
  Scalar ratio{1};               ///< r [1; rad/m, m/rad where one joint slides]
  Scalar stiffness{0};           ///< k ≥ 0, on joint j's side [N·m/rad, N/m]
  Scalar neutral{0};             ///< x_0 [rad, m]
  SeenInterval<Scalar> seen{};   ///< of x [rad, m]
};

/// T of a cable [N·m, N]: add it to joint j, and r T to joint i.
/// @param driving, driven  positions of joints i and j [rad, m]
template <typename Scalar>
constexpr Scalar cable_torque(const JointCable<Scalar>& cable, Scalar driving, Scalar driven) noexcept {
  const Scalar x = driven + cable.ratio * driving;
  return cable.stiffness * (detail::nearest(x, cable.seen.low, cable.seen.high) - cable.neutral);
}

/// The same, added to the torque of both joints.
/// @param q, tau  n: positions [rad, m] and torque [N·m, N]
template <typename Scalar, typename Positions, typename Torque>
constexpr void add_cable(const JointCable<Scalar>& cable, const Positions& q, Torque& tau) noexcept {
  const Scalar pull = cable_torque(cable, q[cable.driving], q[cable.driven]);
  tau[cable.driven] += pull;
  tau[cable.driving] += cable.ratio * pull;
}

}  // namespace heft
