/// @file
/// Viscous friction that does not grow in proportion to speed.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// c |q̇|^p sign(q̇) in addition to the linear viscous term, c ≥ 0: p = 0.6 levels off, p = 3 grows faster than speed.
struct ViscousNonlinear {
  static constexpr std::string_view kId = "viscous_nonlinear";
  static constexpr std::string_view kEquation = "c |qd|^p sign(qd)";
  static constexpr std::array<EffectParameter, 2> kParameters{
      {{"c", "N·m·(s/rad)^p", "N·(s/m)^p"}, {"p", "1", "1", EffectRange::kPositive}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{0.6, 3.0, ShapeScale::kAbsolute, 2, false, true}}};
  static constexpr SeenBy kHeldBeyond = SeenBy::kVelocity;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy = "constant speeds from slow to the fastest allowed";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar p, const EffectPoint<Scalar>& x) {
    using std::abs;
    using std::pow;
    return {pow(abs(x.qd), p) * x.direction};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar p,
                                             const JointActuation<Scalar>&) {
    return {c[0], p};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * columns(p[1], x)[0];
  }
};

}  // namespace heft
