/// @file
/// A constant torque.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// Offset τ_0: a bias of the torque channel, or Coulomb levels that differ between the two directions
/// (F_c + τ_0 forward, F_c - τ_0 backward). The two differ only at standstill.
struct Offset {
  static constexpr std::string_view kId = "offset";
  static constexpr std::string_view kEquation = "tau0";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"tau0", "N·m", "N"}}};
  static constexpr std::array<ShapeRange, 0> kShapes{};
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{false};
  static constexpr std::string_view kShownBy = "the same poses passed in both directions, and standstill";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>&) {
    return {Scalar(1)};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar,
                                             const JointActuation<Scalar>&) {
    return {c[0]};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>&,
                       const JointActuation<Scalar>&) {
    return p[0];
  }
};

}  // namespace heft
