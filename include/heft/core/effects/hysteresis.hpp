/// @file
/// Friction that turns over within some travel after a reversal.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// Presliding: the Coulomb term F_c sign(q̇) becomes F_c z with dz = (sign(dq) - z) |dq| / x_0. What this effect
/// adds to the declared model is F_c (z - sign(q̇)). The state z starts at 0 and forgets its start within a few x_0.
/// P. R. Dahl, A solid friction model, The Aerospace Corporation, TOR-0158(3107-18), 1968.
struct Hysteresis {
  static constexpr std::string_view kId = "hysteresis";
  static constexpr std::string_view kEquation = "Fc (z - sign(qd)), dz = (sign(dq) - z) |dq| / x0";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"x0", "rad", "m"}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{2e-4, 0.1, ShapeScale::kTravel, 14, false, false}}};
  /// Its column, z, stands in for sign(q̇): the fitted coefficient is the joint's Coulomb friction.
  static constexpr bool kReplacesCoulomb = true;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy =
      "small slow reversals: a few hundredths of the travel back and forth";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>& x) {
    return {x.memory};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>&, Scalar x0,
                                             const JointActuation<Scalar>&) {
    return {x0};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>&, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>& joint) {
    return joint.coulomb_friction * (x.memory - x.direction);
  }
  /// z after `travel` in one direction, exactly: z ← s + (z - s) exp(-|travel|/x_0), s = sign(travel).
  /// @param travel  [rad, m], with its sign
  template <typename Scalar>
  static Scalar memory(const EffectParameters<Scalar>& p, Scalar z, Scalar travel) {
    using std::abs;
    using std::exp;
    const Scalar s = travel > Scalar(0) ? Scalar(1) : Scalar(-1);
    return s + (z - s) * exp(-abs(travel) / p[0]);
  }
  /// dz/dt [1/s].
  template <typename Scalar>
  static Scalar memory_rate(const EffectParameters<Scalar>& p, Scalar z, Scalar direction, Scalar velocity) {
    using std::abs;
    return (direction - z) * abs(velocity) / p[0];
  }
};

}  // namespace heft
