/// @file
/// What the values of a series span, and which of them can be drawn.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "heft/page/plot.hpp"

namespace heft::page {

struct Range {
  double low{std::numeric_limits<double>::infinity()};
  double high{-std::numeric_limits<double>::infinity()};
  void include(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool empty() const { return !(low <= high); }
};

/// What both axes span.
struct Extent {
  Range x, y;
};

/// False for a value that leaves a gap: not finite, or not above zero on a logarithmic axis.
inline bool can_be_shown(double value, bool logarithmic) {
  return std::isfinite(value) && (!logarithmic || value > 0.0);
}

/// Series with two heights at each x.
inline bool has_high(Style style) { return style == Style::kBand || style == Style::kIntervals; }

}  // namespace heft::page
