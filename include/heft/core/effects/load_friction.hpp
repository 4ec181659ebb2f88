/// @file
/// Friction that grows with the torque a gear transmits.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// μ |τ_load| sign(q̇), μ ≥ 0, with τ_load the torque of the rigid bodies that the joint transmits (motor torque
/// less friction).
/// P. Hamon et al., New dry friction model with load- and velocity-dependence, ICRA 2011.
struct LoadFriction {
  static constexpr std::string_view kId = "load_friction";
  static constexpr std::string_view kEquation = "mu |tau_load| sign(qd)";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"mu", "1", "1"}}};
  static constexpr std::array<ShapeRange, 0> kShapes{};
  static constexpr SeenBy kHeldBeyond = SeenBy::kLoad;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy = "the same speeds under small and large gravity load";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>& x) {
    using std::abs;
    return {abs(x.load) * x.direction};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar,
                                             const JointActuation<Scalar>&) {
    return {c[0]};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>&) {
    return p[0] * columns(Scalar(0), x)[0];
  }
};

}  // namespace heft
