/// @file
#pragma once

#include <algorithm>
#include <vector>

#include "heft/host/numbers.hpp"

namespace heft::monitor {

/// The middle of the values, the upper one of two; NaN of none.
inline double median_of(std::vector<double> values) {
  if (values.empty()) return kNaN;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace heft::monitor
