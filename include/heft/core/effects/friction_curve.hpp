/// @file
/// Friction over speed as a curve that no formula prescribes.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// (F1 h(|q̇|/V) + F2 h(3 |q̇|/V) + F3 h(9 |q̇|/V)) sign(q̇), h(u) = max(0, 1 - u): a linear spline over speed with knots at
/// V/9, V/3 and V, on top of Coulomb and viscous friction, which alone hold from V on.
///
/// The honest alternative where neither a Stribeck curve nor a power of the speed describes a joint: it states the
/// friction measured, with three values that may have either sign, and zero beyond the speeds that it was fitted to.
struct FrictionCurve {
  static constexpr std::string_view kId = "friction_curve";
  static constexpr std::string_view kName = "friction over speed that follows no known formula";
  static constexpr std::string_view kEquation =
      "(F1 h(|qd|/V) + F2 h(3|qd|/V) + F3 h(9|qd|/V)) sign(qd), h(u) = max(0, 1-u)";
  static constexpr std::array<EffectParameter, 4> kParameters{
      {{"F1", "N·m", "N"},
       {"F2", "N·m", "N"},
       {"F3", "N·m", "N"},
       {"V", "rad/s", "m/s", EffectRange::kPositive}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{0.3, 0.9, ShapeScale::kTopSpeed, 4, false, false}}};
  static constexpr SeenBy kHeldBeyond = SeenBy::kVelocity;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 3> kNotNegative{false, false, false};
  static constexpr std::string_view kShownBy = "constant speeds from slow to the fastest allowed";

  template <typename Scalar>
  static std::array<Scalar, 3> columns(Scalar top, const EffectPoint<Scalar>& x) {
    using std::abs;
    const Scalar u = abs(x.qd) / top;
    const auto hat = [&](Scalar v) { return v < Scalar(1) ? (Scalar(1) - v) * x.direction : Scalar(0); };
    return {hat(u), hat(Scalar(3) * u), hat(Scalar(9) * u)};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 3>& c, Scalar top,
                                             const JointActuation<Scalar>&) {
    return {c[0], c[1], c[2], top};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    const auto h = columns(p[3], x);
    return p[0] * h[0] + p[1] * h[1] + p[2] * h[2];
  }
};

}  // namespace heft
