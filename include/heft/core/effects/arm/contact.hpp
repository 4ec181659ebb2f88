/// @file
/// A force on the tool that comes and goes.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// An outer force F at the tool for a while: the motors bring up -J^T F more.
struct Contact {
  static constexpr std::string_view kId = "contact";
  static constexpr std::string_view kEquation = "J^T F at the tool";
  /// Of each event, besides its force [N].
  static constexpr std::array<EffectParameter, 2> kParameters{{{"t0", "s", "s"}, {"duration", "s", "s"}}};
  static constexpr std::string_view kShownBy = "the same motion once more without touching anything";
};

}  // namespace heft
