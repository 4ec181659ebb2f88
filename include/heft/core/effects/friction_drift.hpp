/// @file
/// A joint that warms up.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// Coulomb and viscous friction that fall while the joint warms up: F_c (1 + α_c e^{-t/T}), F_v (1 + α_v e^{-t/T}).
/// This effect adds F_c α_c e^{-t/T} sign(q̇) + F_v α_v e^{-t/T} q̇; t from a cold joint.
struct FrictionDrift {
  static constexpr std::string_view kId = "friction_drift";
  static constexpr std::string_view kEquation = "Fc alpha_c exp(-t/T) sign(qd) + Fv alpha_v exp(-t/T) qd";
  static constexpr std::array<EffectParameter, 3> kParameters{
      {{"alpha_c", "1", "1"}, {"alpha_v", "1", "1"}, {"T", "s", "s", EffectRange::kPositive}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{0.05, 2.0, ShapeScale::kDuration, 8, false, false}}};
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 2> kNotNegative{true, true};
  static constexpr std::string_view kShownBy = "the same motion with a cold and with a warm joint";

  template <typename Scalar>
  static std::array<Scalar, 2> columns(Scalar T, const EffectPoint<Scalar>& x) {
    using std::exp;
    const Scalar cold = exp(-x.time / T);
    return {cold * x.direction, cold * x.qd};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 2>& c, Scalar T,
                                             const JointActuation<Scalar>& joint) {
    const auto share = [](Scalar part, Scalar whole) {
      return whole != Scalar(0) ? part / whole : Scalar(0);
    };
    return {share(c[0], joint.coulomb_friction), share(c[1], joint.viscous_friction), T};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>& joint) {
    using std::exp;
    const Scalar cold = exp(-x.time / p[2]);
    return cold * (joint.coulomb_friction * p[0] * x.direction + joint.viscous_friction * p[1] * x.qd);
  }
};

}  // namespace heft
