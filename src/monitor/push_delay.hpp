/// @file
/// How soon thresholds find a push.
#pragma once

#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// Time after which the residual that a growing push causes, or its change, exceeds its threshold [s]; NaN: not within 10 s.
/// @param thresholds     for their filters
/// @param level,change   thresholds [N·m, N]
/// @param rate           of the push [N·m/s]
double push_delay(const Thresholds& thresholds, double level, double change, double rate = kPushRate);

}  // namespace heft::monitor
