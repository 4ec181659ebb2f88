/// @file
/// The motor's own inertia.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// I_a q̈, I_a ≥ 0: inertia of the motor on the joint's side of the gear, felt by this joint alone.
struct RotorInertia {
  static constexpr std::string_view kId = "rotor_inertia";
  static constexpr std::string_view kEquation = "Ia qdd";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"Ia", "kg·m²", "kg"}}};
  static constexpr std::array<ShapeRange, 0> kShapes{};
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy =
      "strong accelerations of this joint while the joints before it rest";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>& x) {
    return {x.qdd};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar,
                                             const JointActuation<Scalar>&) {
    return {c[0]};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * x.qdd;
  }
};

}  // namespace heft
