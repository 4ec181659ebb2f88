/// @file
/// An elastic joint, as an effect to be found.
#pragma once

#include "heft/core/effects/effect_point.hpp"
#include "heft/core/effects/elasticity.hpp"

namespace heft {

/// An Elasticity. It sits in one joint, but its link's motion reaches the torque of all: no joint effect can state it.
struct ElasticJoint {
  static constexpr std::string_view kId = "elasticity";
  static constexpr std::string_view kEquation = "Jm th'' + friction(th') + K (th - x) + D (th' - x')";
  static constexpr std::array<EffectParameter, 3> kParameters{
      {{"stiffness", "N·m/rad", "N/m", EffectRange::kPositive},
       {"damping", "N·m·s/rad", "N·s/m"},
       {"motor_inertia", "kg·m²", "kg"}}};
  static constexpr std::string_view kShownBy =
      "strong short accelerations of this joint, with and without load, or an encoder on the link";
};

}  // namespace heft
