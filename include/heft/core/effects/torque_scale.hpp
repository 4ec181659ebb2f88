/// @file
/// A joint whose reported torque has another scale than the rest of the arm.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// s τ_load, τ_load the torque of the rigid bodies that the joint transmits (motor torque less friction).
///
/// Two causes that a log in motion cannot distinguish:
/// - the torque constant, gear ratio or sensor gain of the joint is off by the share s (friction, fitted in the same
///   scale, takes the share along);
/// - friction that grows with load differs between driving and back-driving, μ_d |τ_load| sign(q̇) while τ_load q̇ > 0 and
///   μ_b |τ_load| sign(q̇) while it is below 0: since |τ| sign(q̇) sign(τ q̇) = τ, that is LoadFriction with
///   (μ_d + μ_b)/2 and this effect with s = (μ_d - μ_b)/2.
struct TorqueScale {
  static constexpr std::string_view kId = "torque_scale";
  static constexpr std::string_view kName =
      "a torque scale of its own, or a gear that drives harder than it is driven";
  static constexpr std::string_view kEquation = "s tau_load";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"s", "1", "1"}}};
  static constexpr std::array<ShapeRange, 0> kShapes{};
  static constexpr SeenBy kHeldBeyond = SeenBy::kLoad;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{false};
  static constexpr std::string_view kShownBy = "large gravity load of both signs that several joints share";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>& x) {
    return {x.load};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar,
                                             const JointActuation<Scalar>&) {
    return {c[0]};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * x.load;
  }
};

}  // namespace heft
