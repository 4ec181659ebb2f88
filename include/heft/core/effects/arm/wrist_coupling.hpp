/// @file
/// A motor that turns with two joints, as an effect to be found.
#pragma once

#include "heft/core/effects/effect_point.hpp"
#include "heft/core/friction/gear_coupling.hpp"

namespace heft {

/// A GearCoupling: friction and inertia of a motor that turns with q_j + r q_i reach joints i and j. In most wrists
/// these are joints 5 and 6.
struct WristCoupling {
  static constexpr std::string_view kId = "wrist_coupling";
  /// `{i}` and `{j}` are the numbers of the driving and the driven joint.
  static constexpr std::string_view kEquation = "Fc sign(qd{i} + qd{j}) + Fv (qd{i} + qd{j}) on both";
  static constexpr std::array<EffectParameter, 3> kParameters{
      {{"Fc", "N·m", "N"}, {"Fv", "N·m·s/rad", "N·s/m"}, {"Ia", "kg·m²", "kg"}}};
  static constexpr std::string_view kShownBy =
      "joints {i} and {j} moved one at a time and together, in both senses";
};

}  // namespace heft
