// A series reduced to what the eye can see on a drawing of given size.
#include <cstdint>
#include <unordered_set>

#include "extent.hpp"
#include "heft/host/numbers.hpp"
#include "heft/page/plot.hpp"

namespace heft::page {
namespace {

/// Extremes of each pixel column, in the order in which they occur.
Series thin_by_columns(const Series& series, int width, const std::vector<double>& column) {
  Series out{series.label, {}, {}, {}, series.style, series.hue};
  const bool is_band = series.style == Style::kBand;
  const auto add = [&](std::size_t k) {
    out.x.push_back(series.x[k]);
    out.y.push_back(series.y[k]);
  };
  std::size_t k = 0;
  while (k < column.size()) {
    if (!std::isfinite(column[k])) {  // a gap stays a gap, once
      if (!out.x.empty() && std::isfinite(out.x.back())) {
        out.x.push_back(kNaN);
        out.y.push_back(kNaN);
        if (is_band) out.y_high.push_back(kNaN);
      }
      ++k;
      continue;
    }
    const double pixel = std::min(std::floor(column[k]), static_cast<double>(width - 1));
    std::size_t low = k, high = k, last = k;
    double top = is_band ? series.y_high[k] : 0.0;
    while (last < column.size() && std::isfinite(column[last]) &&
           std::min(std::floor(column[last]), static_cast<double>(width - 1)) == pixel) {
      if (series.y[last] < series.y[low]) low = last;
      if (series.y[last] > series.y[high]) high = last;
      if (is_band) top = std::max(top, series.y_high[last]);
      ++last;
    }
    if (is_band) {
      out.x.push_back(series.x[k]);
      out.y.push_back(series.y[low]);
      out.y_high.push_back(top);
    } else if (series.style == Style::kSteps) {
      // The value that holds at the column's end matters for what follows.
      if (low != last - 1 && high != last - 1) add(std::min(low, high));
      if (low != high && std::max(low, high) != last - 1) add(std::max(low, high));
      add(last - 1);
    } else {
      add(std::min(low, high));
      if (low != high) add(std::max(low, high));
    }
    k = last;
  }
  return out;
}

/// Place of a value along an axis [px].
double pixel_of(double value, const Range& range, bool logarithmic, int pixels) {
  if (!(range.high > range.low)) return 0.0;
  const double part = logarithmic ? std::log(value / range.low) / std::log(range.high / range.low)
                                  : (value - range.low) / (range.high - range.low);
  return part * pixels;
}

}  // namespace

Series decimate(const Series& series, int width, int height, bool log_x, bool log_y) {
  Series clean = series;
  const std::size_t size = std::min(series.x.size(), series.y.size());
  clean.x.resize(size);
  clean.y.resize(size);
  if (has_high(series.style)) clean.y_high.resize(size, kNaN);
  // A value that cannot be shown is a gap.
  Range x_range, y_range;
  bool ordered = true;
  double previous = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < size; ++k) {
    const bool shown = can_be_shown(clean.x[k], log_x) && can_be_shown(clean.y[k], log_y) &&
                       (!has_high(series.style) || std::isfinite(clean.y_high[k]));
    if (!shown) {
      clean.x[k] = clean.y[k] = kNaN;
      continue;
    }
    ordered = ordered && clean.x[k] >= previous;
    previous = clean.x[k];
    x_range.include(clean.x[k]);
    y_range.include(clean.y[k]);
  }
  if (series.style == Style::kBars || series.style == Style::kDots || series.style == Style::kIntervals ||
      size <= static_cast<std::size_t>(2 * width) || x_range.empty())
    return clean;

  if (ordered && series.style != Style::kPoints) {
    std::vector<double> column(size);
    for (std::size_t k = 0; k < size; ++k) column[k] = pixel_of(clean.x[k], x_range, log_x, width);
    return thin_by_columns(clean, width, column);
  }
  // Points, or a curve that turns back: one point a pixel is all that shows.
  Series out{series.label, {}, {}, {}, series.style, series.hue};
  std::unordered_set<std::int64_t> seen;
  std::int64_t last_cell = -1;
  for (std::size_t k = 0; k < size; ++k) {
    std::int64_t cell = -2;
    if (std::isfinite(clean.x[k])) {
      cell = static_cast<std::int64_t>(pixel_of(clean.x[k], x_range, log_x, width)) * (height + 1) +
             static_cast<std::int64_t>(pixel_of(clean.y[k], y_range, log_y, height));
    }
    const bool is_new =
        series.style == Style::kPoints ? cell >= 0 && seen.insert(cell).second : cell != last_cell;
    last_cell = cell;
    if (!is_new) continue;
    out.x.push_back(clean.x[k]);
    out.y.push_back(clean.y[k]);
    if (series.style == Style::kBand) out.y_high.push_back(clean.y_high[k]);
  }
  return out;
}

}  // namespace heft::page
