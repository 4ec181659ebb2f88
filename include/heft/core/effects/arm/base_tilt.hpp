/// @file
/// A base that is not level.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// Gravity has a horizontal component in the base frame: its direction (azimuth) and the angle between gravity and the
/// base's vertical (tilt).
struct BaseTilt {
  static constexpr std::string_view kId = "base_tilt";
  static constexpr std::string_view kEquation = "gravity turned by the tilt";
  static constexpr std::array<EffectParameter, 2> kParameters{
      {{"tilt_deg", "°", "°"}, {"azimuth_deg", "°", "°"}}};
  static constexpr std::string_view kShownBy =
      "slow sweeps of the first joint over its whole travel with the arm stretched out";
};

}  // namespace heft
