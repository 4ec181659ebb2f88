/// @file
/// A body that the tool picks up or drops.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// From `time` on the last link carries a body more, or one less; com is in the last link's frame.
struct PayloadChange {
  static constexpr std::string_view kId = "payload_change";
  static constexpr std::string_view kEquation = "a body on the last link, from then on or until then";
  static constexpr std::array<EffectParameter, 5> kParameters{{{"mass", "kg", "kg"},
                                                               {"time", "s", "s"},
                                                               {"com_x", "m", "m"},
                                                               {"com_y", "m", "m"},
                                                               {"com_z", "m", "m"}}};
  static constexpr std::string_view kShownBy = "the wrist turned through many orientations before and after";
};

}  // namespace heft
