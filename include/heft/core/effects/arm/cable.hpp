/// @file
/// A cable over two joints, as an effect to be found.
#pragma once

#include "heft/core/effects/cable.hpp"
#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// A JointCable. Its torque in each of the joints goes by the positions of both.
struct Cable {
  static constexpr std::string_view kId = "cable";
  /// `{i}` and `{j}` are the numbers of the driving and the driven joint.
  static constexpr std::string_view kEquation = "k (q{j} + ratio q{i} - x0) on joint {j}, ratio times that on joint {i}";
  static constexpr std::array<EffectParameter, 3> kParameters{
      {{"k", "N·m/rad", "N/m", EffectRange::kPositive}, {"x0", "rad", "m"}, {"ratio", "", ""}}};
  static constexpr std::string_view kShownBy =
      "slow sweeps of joints {i} and {j} over their whole travel, one at a time and together, in both senses";
};

}  // namespace heft
