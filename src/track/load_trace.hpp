/// @file
/// The estimate of a load observer over time.
#pragma once

#include <array>
#include <cstddef>

#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/track/controllers.hpp"

namespace heft::track {

/// Appends what an observer made of a sample.
/// @param observer  heft::LoadObserver
template <typename Observer>
void note_load(const Observer& observer, const typename Observer::Record& record, double time,
               LoadTrace& trace) {
  if (record.changed) trace.change.push_back(time);
  if (!record.due) return;
  const LoadEstimate<double> found = observer.estimate();
  const double half = record.settling ? kNaN : statistics::kNormal95 * found.std[kMass];
  trace.time.push_back(time);
  trace.mass.push_back(record.settling ? kNaN : found.value[kMass]);
  trace.mass_half_width.push_back(half);
  std::array<double, 3> com{kNaN, kNaN, kNaN}, com_half{kNaN, kNaN, kNaN};
  if (found.value[kMass] > 3 * half) {
    for (std::size_t a = 0; a < 3; ++a) {
      com[a] = found.com[a];
      com_half[a] = statistics::kNormal95 * found.com_std[a];
    }
  }
  trace.com.push_back(com);
  trace.com_half_width.push_back(com_half);
}

}  // namespace heft::track
