/// @file
/// Thresholds of contacts as core's contact monitor takes them.
#pragma once

#include <cstddef>

#include "heft/core/monitor/contact_thresholds.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// @pre thresholds.joints.size() == N
template <int N>
ContactThresholds<double, N> sized_thresholds(const Thresholds& thresholds) {
  ContactThresholds<double, N> to;
  to.bandwidth = thresholds.bandwidth;
  to.adaptation = thresholds.adaptation;
  to.turning_time = thresholds.turning_time;
  to.load_rate = thresholds.load_rate;
  to.largest_step = thresholds.largest_step;
  for (std::size_t j = 0; j < to.joints.size(); ++j) to.joints[j] = thresholds.joints[j];
  return to;
}

}  // namespace heft::monitor
