#include "plot_data.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "compact_svg.hpp"
#include "host/json.hpp"
#include "map_script.hpp"
#include "palette.hpp"
#include "plot_script.hpp"

namespace heft::page {
namespace {

using host::Json;

Json axis(double low_pixel, double high_pixel, const Range& range, bool logarithmic,
          const std::string& label) {
  return {{"pixels", {low_pixel, high_pixel}},
          {"range", {range.low, range.high}},
          {"log", logarithmic},
          {"label", label}};
}

const char* name_of(Style style) {
  switch (style) {
    case Style::kLine:
    case Style::kDashed: return "line";
    case Style::kSteps: return "steps";
    case Style::kPoints: return "points";
    case Style::kDots: return "dots";
    case Style::kIntervals: return "intervals";
    case Style::kBand: return "band";
    case Style::kBars: break;
  }
  return "bars";
}

Json marks_of(const PlotSpec& spec) {
  Json marks = Json::array();
  for (const Mark& mark : spec.marks) {
    if (!std::isfinite(mark.at)) continue;
    marks.push_back(
        {{mark.direction == Mark::Direction::kVertical ? "x" : "y", mark.at}, {"label", mark.label}});
  }
  return marks;
}

std::string escaped(const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  replace_all(text, "&", "&amp;");
  replace_all(text, "<", "&lt;");
  replace_all(text, "'", "&#39;");
  return text;
}

/// Of all series of a drawing: 40 kB of a page.
constexpr std::size_t kMostPoints = 4000;

double pixel_on_axis(double value, const Range& range, bool logarithmic, double low, double high) {
  const double part = logarithmic ? std::log(value / range.low) / std::log(range.high / range.low)
                                  : (value - range.low) / (range.high - range.low);
  return low + part * (high - low);
}

/// Points one by one where each stands alone, else joined up to the next gap. What lies outside the axes is left out.
std::string path_of(const Series& series, const Extent& shown, const Frame& frame, const PlotSpec& spec) {
  const bool alone = series.style == Style::kPoints || series.style == Style::kDots;
  std::string path;
  bool joined = false;
  for (std::size_t k = 0; k < series.x.size(); ++k) {
    if (!can_be_shown(series.x[k], spec.log_x) || !can_be_shown(series.y[k], spec.log_y)) {
      joined = false;
      continue;
    }
    const double x = pixel_on_axis(series.x[k], shown.x, spec.log_x, frame.left, frame.right);
    const auto add = [&](double value) {
      const double y = pixel_on_axis(value, shown.y, spec.log_y, frame.bottom, frame.top);
      if (alone && !(y >= frame.top && y <= frame.bottom)) return;
      path += fmt::format("{}{:.1f},{:.1f}{}", joined ? ' ' : 'M', x, std::clamp(y, frame.top, frame.bottom),
                          alone ? "h0" : "");
      joined = !alone;
    };
    add(series.y[k]);
    if (has_high(series.style) && can_be_shown(series.y_high[k], spec.log_y)) add(series.y_high[k]);
  }
  return path;
}

}  // namespace

std::string plot_data(const PlotSpec& spec, const Drawing& drawing) {
  if (!drawing.frame) return {};
  const Frame& frame = *drawing.frame;
  const Extent shown = extent_shown(spec);
  Json json{{"x", axis(frame.left, frame.right, shown.x, spec.log_x, spec.x_label)},
            {"y", axis(frame.bottom, frame.top, shown.y, spec.log_y, spec.y_label)},
            {"series", Json::array()}};
  const std::vector<std::size_t> colours = colours_of(spec);
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series& series = spec.series[k];
    json["series"].push_back({{"label", series.label},
                              {"style", name_of(series.style)},
                              {"colour", kPalette[colours[k]].variable}});
  }
  if (!spec.categories.empty()) json["categories"] = spec.categories;
  if (Json marks = marks_of(spec); !marks.empty()) json["marks"] = std::move(marks);
  if (spec.y_range) json["cut"] = true;
  return escaped(json);
}

std::string plot_data(const MapSpec& spec, const Drawing& drawing) {
  if (!drawing.frame) return {};
  const Frame& frame = *drawing.frame;
  Json json{{"x", axis(frame.left, frame.right, {spec.x.front(), spec.x.back()}, false, spec.x_label)},
            {"y", axis(frame.bottom, frame.top, {spec.y.front(), spec.y.back()}, false, spec.y_label)},
            {"value", spec.value_label},
            {"levels", Json::array()}};
  // Each level lies inside the one before: where one is missing in the drawing, so are all above it.
  const std::size_t count = spec.levels.size();
  for (std::size_t k = 0; k <= count && count > 0; ++k) {
    const std::string low = k > 0 ? fmt::format("{:.4g}", spec.levels[k - 1]) : "";
    const std::string high = k < count ? fmt::format("{:.4g}", spec.levels[k]) : "";
    json["levels"].push_back(low.empty() ? "< " + high : high.empty() ? "≥ " + low : low + " … " + high);
    json["tints"].push_back(level_tint(k, count + 1));
    if (k > 0) json["borders"].push_back(low);
  }
  for (const MapSpec::Frame& f : spec.frames) {
    json["frames"].push_back(
        {{"x", {f.x_low, f.x_high}}, {"y", {f.y_low, f.y_high}}, {"label", f.label}, {"dashed", f.dashed}});
  }
  for (const MapSpec::Place& p : spec.places)
    json["places"].push_back({{"x", p.x}, {"y", p.y}, {"label", p.label}});
  return escaped(json);
}

std::string series_points(const PlotSpec& spec, const Drawing& drawing) {
  if (!drawing.frame) return {};
  const Extent shown = extent_shown(spec);
  // Coarser, until a reader who waits for the page does not notice them.
  std::vector<Series> thinned;
  for (int coarse = 2; coarse <= 64; coarse *= 2) {
    thinned.clear();
    std::size_t count = 0;
    for (Series series : spec.series) {
      // Of a curve that turns back, once a place rather than once a turn.
      if (!has_high(series.style) && !std::is_sorted(series.x.begin(), series.x.end()))
        series.style = Style::kPoints;
      thinned.push_back(decimate(series, spec.width / coarse, spec.height / coarse, spec.log_x, spec.log_y));
      count += thinned.back().x.size();
    }
    if (count <= kMostPoints) break;
  }
  std::string text;
  for (std::size_t k = 0; k < thinned.size(); ++k) {
    text += fmt::format("<g class=\"series\" data-i=\"{}\" visibility=\"hidden\"><path d=\"{}\"/></g>\n", k,
                        path_of(thinned[k], shown, *drawing.frame, spec));
  }
  return text;
}

}  // namespace heft::page
