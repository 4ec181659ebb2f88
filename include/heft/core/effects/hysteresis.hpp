/// @file
/// Friction that turns over within some travel after a reversal.
#pragma once

#include <cmath>

#include "heft/core/effects/effect_point.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft {

/// Presliding: the Coulomb term F_c sign(q̇) becomes F_c z with dz = (sign(dq) - z) |dq| / x_0. Where a joint has
/// several places that slide, a part s of its friction may turn over at once: F_c (s sign(q̇) + (1 - s) z). What
/// this effect adds to the declared model is F_c (1 - s) (z - sign(q̇)). The state z forgets its start within a few
/// x_0; it starts at 0, or where a joint at rest is seen to be held.
/// P. R. Dahl, A solid friction model, The Aerospace Corporation, TOR-0158(3107-18), 1968. The sum of a sharp and a
/// gradual part is the simplest of the parallel arrangements of W. D. Iwan, J. Appl. Mech. 33 (1966) 893.
struct Hysteresis {
  static constexpr std::string_view kId = "hysteresis";
  static constexpr std::string_view kEquation =
      "Fc (1 - sharp) (z - sign(qd)), dz = (sign(dq) - z) |dq| / x0";
  static constexpr std::array<EffectParameter, 2> kParameters{
      {{"x0", "rad", "m", EffectRange::kPositive}, {"sharp", "", "", EffectRange::kPart}}};
  static constexpr std::array<ShapeRange, 1> kShapes{{{2e-4, 0.1, ShapeScale::kTravel, 14, false, false}}};
  /// Its column, z - sign(q̇), takes the place of the Coulomb friction, wholly (the fitted coefficient is all of
  /// F_c) or in part.
  static constexpr bool kReplacesCoulomb = true;
  /// Which coefficients physics keeps from being negative.
  static constexpr std::array<bool, 1> kNotNegative{true};
  static constexpr std::string_view kShownBy =
      "small slow reversals: a few hundredths of the travel back and forth";

  template <typename Scalar>
  static std::array<Scalar, 1> columns(Scalar, const EffectPoint<Scalar>& x) {
    return {x.memory - x.direction};
  }
  template <typename Scalar>
  static EffectParameters<Scalar> parameters(const std::array<Scalar, 1>& c, Scalar x0,
                                             const JointActuation<Scalar>& joint) {
    if (!(joint.coulomb_friction > Scalar(0))) return {x0};
    const Scalar sharp = Scalar(1) - c[0] / joint.coulomb_friction;
    return {x0, sharp < Scalar(0) ? Scalar(0) : sharp > Scalar(1) ? Scalar(1) : sharp};
  }
  template <typename Scalar>
  static Scalar torque(const EffectParameters<Scalar>& p, const EffectPoint<Scalar>& x,
                       const JointActuation<Scalar>& joint) {
    return joint.coulomb_friction * (Scalar(1) - p[1]) * (x.memory - x.direction);
  }
  /// z that holds a joint at rest: z = τ / (F_c (1 - s)), within [-1, 1].
  /// @param held  torque that friction holds the joint with [N·m, N]; any that is not finite gives 0
  template <typename Scalar>
  static Scalar memory_at_rest(const EffectParameters<Scalar>& p, Scalar held,
                               const JointActuation<Scalar>& joint) {
    const Scalar most = joint.coulomb_friction * (Scalar(1) - p[1]);
    if (!(most > Scalar(0)) || !is_finite(held)) return Scalar(0);
    return held > most ? Scalar(1) : held < -most ? Scalar(-1) : held / most;
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
