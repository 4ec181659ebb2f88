/// @file
/// Friction that follows the temperature of its joint, where that is measured.
#pragma once

#include "heft/core/effects/effect_point.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft {

/// (k_c sign(q̇) + k_v q̇) (ϑ - ϑ_0): Coulomb and viscous friction change with the temperature ϑ of the joint by k_c and
/// k_v a kelvin; the declared friction is that at ϑ_0. A straight line between the temperatures seen: grease that stiffens
/// in the cold bends it. The viscous part falls as a gear warms up, the Coulomb part may do either.
/// A. C. Bittencourt, S. Gunnarsson, Static friction in a robot joint: modeling and identification of load and temperature
/// effects, ASME J. Dyn. Sys., Meas., Control 134 (2012) 051013.
struct FrictionTemperature {
  static constexpr std::string_view kId = "friction_temperature";
  static constexpr std::string_view kEquation = "(kc sign(qd) + kv qd) (temp - T0)";
  static constexpr std::array<EffectParameter, 3> kParameters{{{"kc", "N·m/K", "N/K"},
                                                               {"kv", "N·m·s/(rad·K)", "N·s/(m·K)"},
                                                               {"T0", "°C", "°C"}}};
  /// ϑ_0 may be any temperature: what it changes is the declared friction.
  static constexpr std::array<ShapeRange, 1> kShapes{{{1.0, 1.0, ShapeScale::kTemperature, 1, false, false}}};
  static constexpr SeenBy kHeldBeyond = SeenBy::kTemperature;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 2> kNotNegative{false, false};
  static constexpr std::string_view kShownBy =
      "the same motion with a cold and with a warm joint, its temperature in the log";

  template <typename Scalar>
  static std::array<Scalar, 2> columns(Scalar T0, const EffectPoint<Scalar>& x) {
    const Scalar warmer = is_finite(x.temperature) ? x.temperature - T0 : Scalar(0);
    return {x.direction * warmer, x.qd * warmer};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 2>& c, Scalar T0,
                                             const JointActuation<Scalar>&) {
    return {c[0], c[1], T0};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    const std::array<Scalar, 2> column = columns(p[2], x);
    return p[0] * column[0] + p[1] * column[1];
  }
};

}  // namespace heft
