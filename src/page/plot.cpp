#include "heft/page/plot.hpp"

#include <fmt/format.h>

#include "compact_svg.hpp"
#include "drawing.hpp"
#include "heft/page/page.hpp"
#include "map_script.hpp"
#include "palette.hpp"
#include "plot_data.hpp"
#include "plot_script.hpp"

namespace heft::page {
namespace {

Drawing drawing_of(const PlotSpec& spec) {
  if (!has_values(spec)) return {{}, "nothing to draw: no finite value"};
  return draw_svg(spec.width, spec.height, [&](auto colour) { return script_of(spec, colour); });
}

Drawing drawing_of(const MapSpec& spec) {
  if (spec.x.size() < 2 || spec.y.size() < 2 ||
      spec.values.rows() != static_cast<Eigen::Index>(spec.x.size()) ||
      spec.values.cols() != static_cast<Eigen::Index>(spec.y.size())) {
    return {{}, "nothing to draw: a map needs two values along each side and one for each pair of them"};
  }
  Drawing drawing = draw_svg(spec.width, spec.height, [&](auto colour) { return script_of(spec, colour); });
  // Smooth edges; gnuplot asks for rough ones.
  replace_all(drawing.body, " shape-rendering='crispEdges'", "");
  return drawing;
}

}  // namespace

Series line(std::string label, const Eigen::VectorXd& x, const Eigen::VectorXd& y, Hue hue) {
  return {std::move(label), {x.begin(), x.end()}, {y.begin(), y.end()}, {}, Style::kLine, hue};
}

Series band(std::string label, const Eigen::VectorXd& x, const Eigen::VectorXd& low,
            const Eigen::VectorXd& high, Hue hue) {
  return {std::move(label),           {x.begin(), x.end()}, {low.begin(), low.end()},
          {high.begin(), high.end()}, Style::kBand,         hue};
}

Series bars(std::string label, std::vector<double> heights, Hue hue) {
  Series series{std::move(label), {}, std::move(heights), {}, Style::kBars, hue};
  for (std::size_t k = 0; k < series.y.size(); ++k) series.x.push_back(static_cast<double>(k));
  return series;
}

std::string legend_html(const PlotSpec& spec) {
  const std::vector<std::size_t> colours = colours_of(spec);
  std::string html;
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series& series = spec.series[k];
    if (series.label.empty()) continue;
    const char* shape = series.style == Style::kDashed   ? "dash"
                        : series.style == Style::kPoints ? "dot"
                        : series.style == Style::kDots   ? "dot"
                        : series.style == Style::kBand   ? "band"
                        : series.style == Style::kBars   ? "bar"
                                                         : "line";
    html += fmt::format("<span class=\"key\"><i class=\"{}\" style=\"--k:var({})\"></i>{}</span>", shape,
                        kPalette[colours[k]].variable, escape_html(series.label));
  }
  return html;
}

std::string render_plot(const PlotSpec& spec) {
  const Drawing drawing = drawing_of(spec);
  return fragment(
      drawing, spec.title, spec.title.empty() ? spec.y_label : spec.title, spec.width, spec.height,
      [&](auto colour) { return script_of(spec, colour); }, plot_data(spec, drawing),
      is_dense(drawing) ? series_points(spec, drawing) : "");
}

std::string render_plot(const MapSpec& spec) {
  const Drawing drawing = drawing_of(spec);
  return fragment(
      drawing, spec.title, spec.title.empty() ? spec.value_label : spec.title, spec.width, spec.height,
      [&](auto colour) { return script_of(spec, colour); }, plot_data(spec, drawing), "");
}

bool write_svg(const MapSpec& spec, const std::string& path) {
  const Drawing drawing = drawing_of(spec);
  if (!drawing.error.empty()) return false;
  write_standalone(drawing, spec.title, {}, spec.width, spec.height, path);
  return true;
}

bool write_svg(const PlotSpec& spec, const std::string& path) {
  const Drawing drawing = drawing_of(spec);
  if (!drawing.error.empty()) return false;
  // On its own the drawing carries its title and legend.
  std::string legend;
  const std::vector<std::size_t> colours = colours_of(spec);
  double x = 12.0;
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series& series = spec.series[k];
    if (series.label.empty()) continue;
    const char* tint = kPalette[colours[k]].light;
    legend += fmt::format(
        "<line x1=\"{:.0f}\" x2=\"{:.0f}\" y1=\"34\" y2=\"34\" stroke=\"{}\" stroke-width=\"3\"{}/>"
        "<text x=\"{:.0f}\" y=\"38\">{}</text>\n",
        x, x + 22, tint, series.style == Style::kDashed ? " stroke-dasharray=\"7 4\"" : "", x + 28,
        escape_html(series.label));
    x += 28 + 7.2 * static_cast<double>(display_width(series.label)) + 22;
  }
  write_standalone(drawing, spec.title, legend, spec.width, spec.height, path);
  return true;
}

}  // namespace heft::page
