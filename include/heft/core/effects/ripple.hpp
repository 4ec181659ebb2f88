/// @file
/// Torque ripple over the turn of a joint: cogging, gear teeth, a torque sensor off centre.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// A sin(n q + φ), n periods a turn (a period every 2π/n metres on a prismatic joint). A gear's teeth and a motor's poles
/// repeat n times a turn of the joint, n any number where the ratio is no whole one; a search looks at whole numbers first.
struct Ripple {
  static constexpr std::string_view kId = "ripple";
  static constexpr std::string_view kEquation = "A sin(n q + phase)";
  static constexpr std::array<EffectParameter, 3> kParameters{
      {{"A", "N·m", "N"}, {"n", "1/turn", "rad/m", EffectRange::kPositive}, {"phase", "rad", "rad"}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{2.0, 100.0, ShapeScale::kAbsolute, 99, true, false}}};
  /// From this share more of the gain on, a number between the whole ones is taken.
  static constexpr double kBetweenWhole = 0.02;
  static constexpr SeenBy kFadesBeyond = SeenBy::kPosition;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 2> kNotNegative{false, false};
  static constexpr std::string_view kShownBy = "slow constant speed over the whole travel of the joint";

  template <typename Scalar>
  static std::array<Scalar, 2> columns(Scalar n, const EffectPoint<Scalar>& x) {
    using std::cos;
    using std::sin;
    return {sin(n * x.q), cos(n * x.q)};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 2>& c, Scalar n,
                                             const JointActuation<Scalar>&) {
    using std::atan2;
    using std::sqrt;
    return {sqrt(c[0] * c[0] + c[1] * c[1]), n, atan2(c[1], c[0])};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    using std::sin;
    return p[0] * sin(p[1] * x.q + p[2]);
  }
};

}  // namespace heft
