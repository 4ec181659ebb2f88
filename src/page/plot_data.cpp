#include "plot_data.hpp"

#include <fmt/format.h>

#include "compact_svg.hpp"
#include "host/json.hpp"
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
  }
  return escaped(json);
}

}  // namespace heft::page
