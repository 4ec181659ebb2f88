/// @file
#pragma once

#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// Time after which the deviation that a growing push causes in a moving joint exceeds a threshold [s]; NaN: never, since
/// the offset follows as fast.
/// @param bandwidth,adaptation  of the thresholds [1/s]
/// @param threshold,offset_limit  [N·m, N]
/// @param rate  of the push [N·m/s]
double push_delay(double bandwidth, double adaptation, double threshold, double offset_limit,
                  double rate = kPushRate);

}  // namespace heft::monitor
