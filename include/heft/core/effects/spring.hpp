/// @file
/// A spring across a joint: a cable, a hose, a gravity compensator.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// k (q - q_0), k ≥ 0.
struct Spring {
  static constexpr std::string_view kId = "spring";
  static constexpr std::string_view kEquation = "k (q - q0)";
  static constexpr std::array<EffectParameter, 2> kParameters{{{"k", "N·m/rad", "N/m"}, {"q0", "rad", "m"}}};
  static constexpr std::array<ShapeRange, 0> kShapes{};
  static constexpr SeenBy kHeldBeyond = SeenBy::kPosition;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 2> kNotNegative{true, false};
  static constexpr std::string_view kShownBy =
      "slow sweeps over the whole travel of the joint, in both directions";

  template <typename Scalar>
  static std::array<Scalar, 2> columns(Scalar, const EffectPoint<Scalar>& x) {
    return {x.q, Scalar(1)};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 2>& c, Scalar,
                                             const JointActuation<Scalar>&) {
    return {c[0], c[0] != Scalar(0) ? -c[1] / c[0] : Scalar(0)};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * (x.q - p[1]);
  }
};

}  // namespace heft
