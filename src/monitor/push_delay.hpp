/// @file
#pragma once

namespace heft::monitor {

/// Time after which the deviation that a push growing by kPushRate causes exceeds a threshold [s]; NaN: never, since the
/// offset follows as fast.
/// @param bandwidth,adaptation  of the thresholds [1/s]
/// @param threshold,offset_limit  [N·m, N]
double push_delay(double bandwidth, double adaptation, double threshold, double offset_limit);

}  // namespace heft::monitor
