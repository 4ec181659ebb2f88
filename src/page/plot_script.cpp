#include "plot_script.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "extent.hpp"
#include "palette.hpp"

namespace heft::page {
namespace {

Extent extent_of(const PlotSpec& spec) {
  Extent extent;
  for (const Series& series : spec.series) {
    const std::size_t size = std::min(series.x.size(), series.y.size());
    for (std::size_t k = 0; k < size; ++k) {
      if (!can_be_shown(series.x[k], spec.log_x) || !can_be_shown(series.y[k], spec.log_y)) continue;
      extent.x.include(series.x[k]);
      extent.y.include(series.y[k]);
      if (k < series.y_high.size()) extent.y.include(series.y_high[k]);
    }
    if (series.style == Style::kBars && !spec.log_y) extent.y.include(0.0);
  }
  for (const Mark& mark : spec.marks) {
    if (mark.direction == Mark::Direction::kHorizontal) extent.y.include(mark.at);
  }
  return extent;
}

/// Leaves a margin above and below the curves.
Range padded(Range range, bool logarithmic, bool from_zero) {
  if (logarithmic) return {range.low / 1.3, range.high * 1.3};
  double margin = 0.06 * (range.high - range.low);
  if (margin <= 0.0) margin = range.low == 0.0 ? 1.0 : 0.1 * std::abs(range.low);
  return {from_zero && range.low == 0.0 ? 0.0 : range.low - margin, range.high + margin};
}

std::string data_block(std::size_t index, const Series& series, double bar_offset) {
  std::string text = fmt::format("$d{} << EOD\n", index);
  const bool two = has_high(series.style);
  const std::size_t size = std::min(series.x.size(), series.y.size());
  for (std::size_t k = 0; k < size; ++k) {
    const bool finite = std::isfinite(series.x[k]) && std::isfinite(series.y[k]) &&
                        (!two || (k < series.y_high.size() && std::isfinite(series.y_high[k])));
    if (!finite) {
      text += "\n";  // an empty line breaks the curve
    } else if (two) {
      text += fmt::format("{:.12g} {:.7g} {:.7g}\n", series.x[k], series.y[k], series.y_high[k]);
    } else {
      text += fmt::format("{:.12g} {:.7g}\n", series.x[k] + bar_offset, series.y[k]);
    }
  }
  return text + "EOD\n";
}

/// Where the series are and what they are drawn on.
struct Layout {
  Extent extent;
  double num_bars{0.0};  ///< bars side by side in a category
  bool has_bars{false};
  bool has_categories{false};
};

Layout layout_of(const PlotSpec& spec) {
  Layout layout;
  layout.num_bars = static_cast<double>(std::count_if(
      spec.series.begin(), spec.series.end(), [](const Series& s) { return s.style == Style::kBars; }));
  layout.extent = extent_of(spec);
  if (spec.equal_axes) {  // a square, so that no side is squeezed
    Extent& extent = layout.extent;
    const double half = 0.53 * std::max(extent.x.high - extent.x.low, extent.y.high - extent.y.low);
    for (Range* range : {&extent.x, &extent.y}) {
      const double middle = 0.5 * (range->low + range->high);
      *range = {middle - half, middle + half};
    }
  }
  layout.has_bars = layout.num_bars > 0;
  layout.has_categories = layout.has_bars || !spec.categories.empty();
  return layout;
}

/// Border, grid, margins and labels.
std::string frame_script(const PlotSpec& spec, const Layout& layout, ColourName colour) {
  std::string s;
  s += "set encoding utf8\nunset key\n";
  s += fmt::format("set border 3 lc rgb '{}' lw 1\nset tics nomirror out scale 0.5\n", colour(kInk));
  s += fmt::format("set grid ytics {} lt 1 lc rgb '{}' lw 1\n", layout.has_categories ? "" : "xtics",
                   colour(kGrid));
  s += "set format y '%.6g'\nset format x '%.6g'\nset samples 2\nset style fill transparent solid 0.2 "
       "noborder\n";
  s += fmt::format("set tmargin {}\nset bmargin {}\nset rmargin 2\n", spec.y_label.empty() ? "0.8" : "1.7",
                   spec.x_label.empty() ? "1.5" : "2.8");
  if (spec.equal_axes) s += "set size ratio -1\n";
  if (spec.log_x) s += "set logscale x\nset format x '%g'\n";
  if (spec.log_y) s += "set logscale y\nset format y '%g'\n";
  if (!spec.x_label.empty()) s += fmt::format("set xlabel {} offset 0,0.3\n", quote(spec.x_label));
  // The quantity is written upright over its axis: easier to read than turned text.
  if (!spec.y_label.empty()) {
    s += fmt::format("set label {} at graph 0, graph 1 left offset -3,0.8\n", quote(spec.y_label));
  }
  return s;
}

/// What the axes go from and to.
Extent shown_extent(const PlotSpec& spec, const Layout& layout) {
  const Extent& extent = layout.extent;
  Extent shown = extent;
  if (layout.has_categories) {
    shown.x = {-0.6, std::max(1.0, static_cast<double>(spec.categories.size())) - 0.4};
  } else if (extent.x.low == extent.x.high) {
    shown.x = padded(extent.x, spec.log_x, false);
  }
  if (spec.y_range) {
    shown.y = {spec.y_range->first, spec.y_range->second};
  } else if (!spec.equal_axes) {
    shown.y = padded(extent.y, spec.log_y, layout.has_bars);
  }
  return shown;
}

/// Ranges of both axes, and the names of categories.
std::string range_script(const PlotSpec& spec, const Layout& layout) {
  const Extent shown = shown_extent(spec, layout);
  std::string s;
  if (layout.has_bars) s += fmt::format("set boxwidth {:.6g}\n", 0.8 / layout.num_bars);
  if (layout.has_categories) {
    s += "set xtics (";
    for (std::size_t k = 0; k < spec.categories.size(); ++k) {
      s += fmt::format("{}{} {}", k ? ", " : "", quote(spec.categories[k]), k);
    }
    s += ") scale 0\n";
  }
  return s + fmt::format("set xrange [{:.12g}:{:.12g}]\nset yrange [{:.9g}:{:.9g}]\n", shown.x.low,
                         shown.x.high, shown.y.low, shown.y.high);
}

/// Dashed lines across the plot with their texts.
std::string mark_script(const PlotSpec& spec, const Extent& extent, ColourName colour) {
  std::string s;
  for (const Mark& mark : spec.marks) {
    if (!std::isfinite(mark.at)) continue;
    const std::string tint = colour(kMark);
    if (mark.direction == Mark::Direction::kVertical) {
      s += fmt::format(
          "set arrow from first {0:.9g}, graph 0 to first {0:.9g}, graph 1 nohead lc rgb '{1}' lw 1 dt "
          "(4,3)\n",
          mark.at, tint);
      // In the right third the text goes to the left of its line, so that it stays on the drawing.
      const bool late = mark.at > extent.x.low + 0.67 * (extent.x.high - extent.x.low);
      s += fmt::format("set label {} at first {:.9g}, graph 1 {} offset {},-0.6 tc rgb '{}' front\n",
                       quote(mark.label), mark.at, late ? "right" : "left", late ? "-0.6" : "0.6", tint);
    } else {
      s += fmt::format(
          "set arrow from graph 0, first {0:.9g} to graph 1, first {0:.9g} nohead lc rgb '{1}' lw 1 dt "
          "(4,3)\n",
          mark.at, tint);
      s += fmt::format("set label {} at graph 1, first {:.9g} right offset -0.4,0.7 tc rgb '{}' front\n",
                       quote(mark.label), mark.at, tint);
    }
  }
  return s;
}

/// The style, as it follows `with`.
std::string how_drawn(Style style, const std::string& tint) {
  switch (style) {
    case Style::kLine: return fmt::format("lines lw 1.6 lc rgb '{}'", tint);
    case Style::kDashed: return fmt::format("lines lw 1.6 dt (7,4) lc rgb '{}'", tint);
    case Style::kSteps: return fmt::format("steps lw 1.6 lc rgb '{}'", tint);
    case Style::kPoints: return fmt::format("points pt 7 ps 0.3 lc rgb '{}'", tint);
    case Style::kDots: return fmt::format("points pt 7 ps 0.65 lc rgb '{}'", tint);
    case Style::kIntervals: return fmt::format("vectors nohead lw 3 lc rgb '{}'", tint);
    case Style::kBand: return fmt::format("filledcurves fs transparent solid 0.2 noborder lc rgb '{}'", tint);
    case Style::kBars: return fmt::format("boxes fs solid 0.9 noborder lc rgb '{}'", tint);
  }
  return {};
}

/// The series and the `plot` command.
std::string series_script(const PlotSpec& spec, double num_bars, ColourName colour) {
  const std::vector<std::size_t> colours = colours_of(spec);
  std::string s;
  std::string plot = "plot ";
  double bar = 0;
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series thin = decimate(spec.series[k], spec.width, spec.height, spec.log_x, spec.log_y);
    double offset = 0.0;
    if (thin.style == Style::kBars) offset = (bar++ - 0.5 * (num_bars - 1)) * 0.8 / num_bars;
    s += data_block(k, thin, offset);
    const std::string tint = colour(colours[k]);
    plot += fmt::format("{}$d{} using {} with {} title {}", k ? ", " : "", k,
                        thin.style == Style::kBand        ? "1:2:3"
                        : thin.style == Style::kIntervals ? "1:2:(0):($3-$2)"
                                                          : "1:2",
                        how_drawn(thin.style, tint), quote(thin.label));
  }
  return s + plot + "\n";
}

}  // namespace

std::vector<std::size_t> colours_of(const PlotSpec& spec) {
  std::vector<std::size_t> colours;
  std::size_t next = 0;
  constexpr std::size_t kNumHues = kPalette.size() - kFirstHue;
  for (const Series& series : spec.series) {
    if (series.hue == Hue::kAuto) {
      colours.push_back(kFirstHue + ++next % kNumHues);  // the neutral one last
    } else {
      colours.push_back(kFirstHue + static_cast<std::size_t>(series.hue) -
                        static_cast<std::size_t>(Hue::kNeutral));
    }
  }
  return colours;
}

Extent extent_shown(const PlotSpec& spec) { return shown_extent(spec, layout_of(spec)); }

bool has_values(const PlotSpec& spec) {
  const Extent extent = extent_of(spec);
  return !extent.x.empty() && !extent.y.empty();
}

std::string script_of(const PlotSpec& spec, ColourName colour) {
  const Layout layout = layout_of(spec);
  return frame_script(spec, layout, colour) + range_script(spec, layout) +
         mark_script(spec, layout.extent, colour) + series_script(spec, layout.num_bars, colour);
}

}  // namespace heft::page
