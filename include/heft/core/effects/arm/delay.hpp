/// @file
/// A torque channel that is late.
#pragma once

#include "heft/core/effects/effect_point.hpp"

namespace heft {

/// The torque in a log is that of `delay` seconds earlier than the positions beside it, in all joints alike.
struct Delay {
  static constexpr std::string_view kId = "delay";
  static constexpr std::string_view kEquation = "tau(t - delay)";
  static constexpr std::array<EffectParameter, 1> kParameters{{{"delay", "s", "s"}}};
  static constexpr std::string_view kShownBy = "quick reversals of one joint at a time";
};

}  // namespace heft
