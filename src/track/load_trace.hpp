/// @file
/// The estimate of a load observer over time.
#pragma once

#include <array>
#include <cmath>
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
  const auto& estimator = observer.estimator();
  const InertialParameters<double> load = estimator.payload();
  const double wide = statistics::kNormal95 * observer.widening();
  const double half = record.settling ? kNaN : wide * estimator.standard_deviation(0);
  trace.time.push_back(time);
  trace.mass.push_back(record.settling ? kNaN : load[kMass]);
  trace.mass_half_width.push_back(half);
  std::array<double, 3> com{kNaN, kNaN, kNaN}, com_half{kNaN, kNaN, kNaN};
  if (std::abs(load[kMass]) > 3 * half) {
    for (std::size_t a = 0; a < 3; ++a) {
      com[a] = load[kMcx + a] / load[kMass];
      typename Observer::Estimator::Row row{};
      row[kMass] = -com[a] / load[kMass];
      row[kMcx + a] = 1 / load[kMass];
      com_half[a] = wide * std::sqrt(estimator.estimator().variance(row));
    }
  }
  trace.com.push_back(com);
  trace.com_half_width.push_back(com_half);
}

}  // namespace heft::track
