/// @file
/// Friction that falls with speed when the joint gets moving.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// Stribeck friction, F_s exp(-(q̇/v_s)²) sign(q̇), F_s ≥ 0.
/// C. Canudas de Wit et al., A new model for control of systems with friction, IEEE TAC 40 (1995).
struct Stribeck {
  static constexpr std::string_view kId = "stribeck";
  static constexpr std::string_view kEquation = "Fs exp(-(qd/vs)^2) sign(qd)";
  static constexpr std::array<EffectParameter, 2> kParameters{
      {{"Fs", "N·m", "N"}, {"vs", "rad/s", "m/s", EffectRange::kPositive}}};
  static constexpr std::array<ShapeRange, 1> kShapes{
      {{0.004, 0.35, ShapeScale::kTopSpeed, 12, false, false}}};
  static constexpr SeenBy kHeldBeyond = SeenBy::kVelocity;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy =
      "slow motion, well below a tenth of the top speed, in both directions";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar vs, const EffectPoint<Scalar>& x) {
    using std::exp;
    const Scalar u = x.qd / vs;
    return {exp(-u * u) * x.direction};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar vs,
                                             const JointActuation<Scalar>&) {
    return {c[0], vs};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * columns(p[1], x)[0];
  }
};

}  // namespace heft
