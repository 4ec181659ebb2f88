#include "heft/report/plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_set>

#include <fmt/format.h>

#include "gnuplot.hpp"
#include "heft/host/file.hpp"
#include "heft/report/report.hpp"
#include "palette.hpp"

namespace heft::report {
namespace {

constexpr std::size_t kMaxSvgBytes = 300 * 1024;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Palette entry of each series; kAuto takes the hues from blue on in turn.
std::vector<std::size_t> colours_of(const PlotSpec& spec) {
  std::vector<std::size_t> colours;
  std::size_t next = 0;
  constexpr std::size_t kNumHues = kPalette.size() - kFirstHue - 1;
  for (const Series& series : spec.series) {
    if (series.hue == Hue::kAuto) {
      colours.push_back(kFirstHue + 1 + next++ % kNumHues);
    } else {
      colours.push_back(kFirstHue + static_cast<std::size_t>(series.hue) -
                        static_cast<std::size_t>(Hue::kNeutral));
    }
  }
  return colours;
}

/// Text as gnuplot's single-quoted string, in which nothing is expanded or executed. gnuplot reads a doubled
/// quote at the beginning as an empty string and goes on with the rest as commands, so an apostrophe becomes
/// a typographic one, which has no meaning to it.
std::string quote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "’";
    } else {
      quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return quoted + "'";
}

/// In the SVG each colour stands first as rgb(1, 0, index), to be replaced by its CSS variable afterwards.
std::string placeholder(std::size_t colour) { return fmt::format("#0100{:02x}", colour); }
std::string solid(std::size_t colour) { return kPalette[colour].light; }

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

bool can_be_shown(double value, bool logarithmic) {
  return std::isfinite(value) && (!logarithmic || value > 0.0);
}

struct Extent {
  Range x, y;
};

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

/// A little air above and below the curves.
Range padded(Range range, bool logarithmic, bool from_zero) {
  if (logarithmic) return {range.low / 1.3, range.high * 1.3};
  double margin = 0.06 * (range.high - range.low);
  if (margin <= 0.0) margin = range.low == 0.0 ? 1.0 : 0.1 * std::abs(range.low);
  return {from_zero && range.low == 0.0 ? 0.0 : range.low - margin, range.high + margin};
}

std::string data_block(std::size_t index, const Series& series, double bar_offset) {
  std::string text = fmt::format("$d{} << EOD\n", index);
  const bool has_high = series.style == Style::kBand;
  const std::size_t size = std::min(series.x.size(), series.y.size());
  for (std::size_t k = 0; k < size; ++k) {
    const bool finite = std::isfinite(series.x[k]) && std::isfinite(series.y[k]) &&
                        (!has_high || (k < series.y_high.size() && std::isfinite(series.y_high[k])));
    if (!finite) {
      text += "\n";  // an empty line breaks the curve
    } else if (has_high) {
      text += fmt::format("{:.9g} {:.7g} {:.7g}\n", series.x[k], series.y[k], series.y_high[k]);
    } else {
      text += fmt::format("{:.9g} {:.7g}\n", series.x[k] + bar_offset, series.y[k]);
    }
  }
  return text + "EOD\n";
}

/// The whole gnuplot script after `set terminal`.
std::string script_of(const PlotSpec& spec, std::string (*colour)(std::size_t)) {
  const std::vector<std::size_t> colours = colours_of(spec);
  const auto num_bars = static_cast<double>(std::count_if(
      spec.series.begin(), spec.series.end(), [](const Series& s) { return s.style == Style::kBars; }));
  const Extent extent = extent_of(spec);
  const bool has_bars = num_bars > 0;

  std::string s;
  s += "set encoding utf8\nunset key\n";
  s += fmt::format("set border 3 lc rgb '{}' lw 1\nset tics nomirror out scale 0.5\n", colour(kInk));
  s += fmt::format("set grid ytics {} lt 1 lc rgb '{}' lw 1\n", has_bars ? "" : "xtics", colour(kGrid));
  s += "set format y '%.6g'\nset format x '%.6g'\nset samples 2\nset style fill transparent solid 0.2 "
       "noborder\n";
  s += fmt::format("set tmargin {}\nset bmargin {}\nset rmargin 2\n", spec.y_label.empty() ? "0.8" : "1.7",
                   spec.x_label.empty() ? "1.5" : "2.8");
  if (spec.log_x) s += "set logscale x\nset format x '%g'\n";
  if (spec.log_y) s += "set logscale y\nset format y '%g'\n";
  if (!spec.x_label.empty()) s += fmt::format("set xlabel {} offset 0,0.3\n", quote(spec.x_label));
  // The quantity stands upright over its axis: easier to read than turned text.
  if (!spec.y_label.empty()) {
    s += fmt::format("set label {} at graph 0, graph 1 left offset -3,0.8\n", quote(spec.y_label));
  }
  if (has_bars) {
    s += fmt::format("set boxwidth {:.6g}\n", 0.8 / num_bars);
    s += fmt::format("set xrange [-0.6:{:.6g}]\n",
                     std::max(1.0, static_cast<double>(spec.categories.size())) - 0.4);
    s += "set xtics (";
    for (std::size_t k = 0; k < spec.categories.size(); ++k) {
      s += fmt::format("{}{} {}", k ? ", " : "", quote(spec.categories[k]), k);
    }
    s += ") scale 0\n";
  } else {
    Range x = extent.x;
    if (x.low == x.high) x = padded(x, spec.log_x, false);
    s += fmt::format("set xrange [{:.9g}:{:.9g}]\n", x.low, x.high);
  }
  if (spec.y_range) {
    s += fmt::format("set yrange [{:.7g}:{:.7g}]\n", spec.y_range->first, spec.y_range->second);
  } else {
    const Range y = padded(extent.y, spec.log_y, has_bars);
    s += fmt::format("set yrange [{:.7g}:{:.7g}]\n", y.low, y.high);
  }
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

  std::string plot = "plot ";
  double bar = 0;
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series thin = decimate(spec.series[k], spec.width, spec.height, spec.log_x, spec.log_y);
    double offset = 0.0;
    if (thin.style == Style::kBars) offset = (bar++ - 0.5 * (num_bars - 1)) * 0.8 / num_bars;
    s += data_block(k, thin, offset);
    const std::string tint = colour(colours[k]);
    std::string how;
    switch (thin.style) {
      case Style::kLine: how = fmt::format("lines lw 1.6 lc rgb '{}'", tint); break;
      case Style::kDashed: how = fmt::format("lines lw 1.6 dt (7,4) lc rgb '{}'", tint); break;
      case Style::kSteps: how = fmt::format("steps lw 1.6 lc rgb '{}'", tint); break;
      case Style::kPoints: how = fmt::format("points pt 7 ps 0.3 lc rgb '{}'", tint); break;
      case Style::kBand:
        how = fmt::format("filledcurves fs transparent solid 0.2 noborder lc rgb '{}'", tint);
        break;
      case Style::kBars: how = fmt::format("boxes fs solid 0.9 noborder lc rgb '{}'", tint); break;
    }
    plot += fmt::format("{}$d{} using {} with {} title {}", k ? ", " : "", k,
                        thin.style == Style::kBand ? "1:2:3" : "1:2", how, quote(thin.label));
  }
  return s + plot + "\n";
}

/// rgb(1, 0, index) becomes var(--name,#light); black is ink.
std::string with_variables(const std::string& svg) {
  std::string out;
  out.reserve(svg.size());
  std::size_t from = 0;
  for (std::size_t at = svg.find("rgb("); at != std::string::npos; at = svg.find("rgb(", from)) {
    const std::size_t close = svg.find(')', at);
    if (close == std::string::npos) break;
    int r = -1, g = -1, b = -1;
    const bool parsed = std::sscanf(svg.c_str() + at, "rgb(%d,%d,%d)", &r, &g, &b) == 3;
    out.append(svg, from, at - from);
    if (parsed && r == 1 && g == 0 && b >= 0 && static_cast<std::size_t>(b) < kPalette.size()) {
      const Colour& colour = kPalette[static_cast<std::size_t>(b)];
      out += fmt::format("var({},{})", colour.variable, colour.light);
    } else {
      out.append(svg, at, close + 1 - at);
    }
    from = close + 1;
  }
  out.append(svg, from);
  return out;
}

void replace_all(std::string& text, const std::string& what, const std::string& with) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + with.size())) {
    text.replace(at, what.size(), with);
  }
}

/// Value of an attribute `name='...'` or `name="..."` in a tag.
std::string attribute(const std::string& tag, const std::string& name) {
  const std::size_t at = tag.find(' ' + name + '=');
  if (at == std::string::npos) return {};
  const char mark = tag[at + name.size() + 2];
  const std::size_t begin = at + name.size() + 3;
  const std::size_t end = tag.find(mark, begin);
  return end == std::string::npos ? std::string{} : tag.substr(begin, end - begin);
}

/// One decimal of a pixel is enough for path data.
std::string with_short_numbers(const std::string& line) {
  std::string out;
  out.reserve(line.size());
  for (std::size_t k = 0; k < line.size(); ++k) {
    out += line[k];
    const bool point = line[k] == '.' && k + 2 < line.size() &&
                       std::isdigit(static_cast<unsigned char>(line[k + 1])) &&
                       std::isdigit(static_cast<unsigned char>(line[k + 2]));
    if (point) {
      out += line[k + 1];
      k += 2;
    }
  }
  return out;
}

/// gnuplot's SVG file made into a small fragment: no XML heading, no definitions, no empty groups, points
/// of one colour as one path.
std::string compact(const std::string& svg) {
  std::string out;
  std::string open_group;    // a <g> that has no content yet
  std::string point_colour;  // of the run of points under way
  std::string point_path;
  const auto flush_points = [&] {
    if (point_path.empty()) return;
    out += fmt::format(
        "<path fill='none' stroke='{}' stroke-width='3.6' stroke-linecap='round' stroke-opacity='0.75' "
        "d='{}'/>\n",
        point_colour, point_path);
    point_path.clear();
  };
  bool in_definitions = false;
  bool in_body = false;
  std::size_t from = 0;
  while (from < svg.size()) {
    std::size_t end = svg.find('\n', from);
    if (end == std::string::npos) end = svg.size();
    std::string line = svg.substr(from, end - from);
    from = end + 1;
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string::npos) continue;
    line.erase(0, first);
    if (!in_body) {  // the heading and <svg ...> itself are written by the caller
      in_body = line.rfind("<g id=\"gnuplot_canvas\">", 0) == 0;
      if (in_body) out += "<g>\n";
      continue;
    }
    if (line.rfind("<defs>", 0) == 0) in_definitions = true;
    if (in_definitions) {
      if (line.rfind("</defs>", 0) == 0) in_definitions = false;
      continue;
    }
    if (line == "</svg>") break;
    if (line.rfind("<use ", 0) == 0) {
      const std::string colour = attribute(line, "color");
      double x = 0, y = 0;
      if (std::sscanf(attribute(line, "transform").c_str(), "translate(%lf,%lf)", &x, &y) == 2) {
        if (colour != point_colour) flush_points();
        point_colour = colour;
        point_path += fmt::format("M{:.1f},{:.1f}h0", x, y);
      }
      continue;
    }
    flush_points();
    if (line.rfind("<g fill=\"none\" color=", 0) == 0) {
      open_group = line;
      continue;
    }
    if (line == "</g>" && !open_group.empty()) {
      open_group.clear();
      continue;
    }
    if (!open_group.empty()) {
      out += open_group + '\n';
      open_group.clear();
    }
    if (line.rfind("<g id=", 0) == 0) {  // ids of several drawings on one page would collide
      const std::size_t close = line.find('>');
      line = "<g>" + line.substr(close + 1);
    }
    out += (line.rfind("<path", 0) == 0 ? with_short_numbers(line) : line) + '\n';
  }
  replace_all(out, "\"black\"", "\"var(--ink,#24292f)\"");
  replace_all(out, "'black'", "'var(--ink,#24292f)'");
  return with_variables(out);
}

std::string base64(const std::string& bytes) {
  static constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - k);
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      word = (word << 8U) | (i < count ? static_cast<unsigned char>(bytes[k + i]) : 0U);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      text += i <= count ? kAlphabet[(word >> (18U - 6U * i)) & 63U] : '=';
    }
  }
  return text;
}

struct Drawing {
  std::string body;  ///< inside <svg>
  std::string error;
};

Drawing draw_svg(const PlotSpec& spec) {
  const Extent extent = extent_of(spec);
  if (extent.x.empty() || extent.y.empty()) return {{}, "nothing to draw: no finite value"};
  const GnuplotResult result =
      run_gnuplot(fmt::format("set terminal svg size {},{} dynamic noenhanced rounded font 'sans-serif,12'\n",
                              spec.width, spec.height) +
                  script_of(spec, placeholder));
  if (!result.ok) return {{}, result.error};
  return {compact(result.output), {}};
}

std::string draw_png(const PlotSpec& spec) {
  const GnuplotResult result = run_gnuplot(fmt::format("set terminal pngcairo size {},{} noenhanced rounded "
                                                       "fontscale 1.6 linewidth 1.6 background '#ffffff'\n",
                                                       2 * spec.width, 2 * spec.height) +
                                           script_of(spec, solid));
  return result.ok ? result.output : std::string{};
}

std::string not_drawn(const PlotSpec& spec, const std::string& reason) {
  return fmt::format("<p class=\"noplot\">{} is not drawn: {}.</p>\n",
                     spec.title.empty() ? "The plot" : "“" + escape_html(spec.title) + "”",
                     escape_html(reason));
}

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

Series decimate(const Series& series, int width, int height, bool log_x, bool log_y) {
  Series clean = series;
  const std::size_t size = std::min(series.x.size(), series.y.size());
  clean.x.resize(size);
  clean.y.resize(size);
  if (series.style == Style::kBand) clean.y_high.resize(size, kNaN);
  // A value that cannot be shown is a gap.
  Range x_range, y_range;
  bool ordered = true;
  double previous = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < size; ++k) {
    const bool shown = can_be_shown(clean.x[k], log_x) && can_be_shown(clean.y[k], log_y) &&
                       (series.style != Style::kBand || std::isfinite(clean.y_high[k]));
    if (!shown) {
      clean.x[k] = clean.y[k] = kNaN;
      continue;
    }
    ordered = ordered && clean.x[k] >= previous;
    previous = clean.x[k];
    x_range.include(clean.x[k]);
    y_range.include(clean.y[k]);
  }
  if (series.style == Style::kBars || size <= static_cast<std::size_t>(2 * width) || x_range.empty())
    return clean;

  const auto scale = [](double value, const Range& range, bool logarithmic, int pixels) {
    if (!(range.high > range.low)) return 0.0;
    const double part = logarithmic ? std::log(value / range.low) / std::log(range.high / range.low)
                                    : (value - range.low) / (range.high - range.low);
    return part * pixels;
  };
  if (ordered && series.style != Style::kPoints) {
    std::vector<double> column(size);
    for (std::size_t k = 0; k < size; ++k) column[k] = scale(clean.x[k], x_range, log_x, width);
    return thin_by_columns(clean, width, column);
  }
  // Points, or a curve that turns back: one point a pixel is all that shows.
  Series out{series.label, {}, {}, {}, series.style, series.hue};
  std::unordered_set<std::int64_t> seen;
  std::int64_t last_cell = -1;
  for (std::size_t k = 0; k < size; ++k) {
    std::int64_t cell = -2;
    if (std::isfinite(clean.x[k])) {
      cell = static_cast<std::int64_t>(scale(clean.x[k], x_range, log_x, width)) * (height + 1) +
             static_cast<std::int64_t>(scale(clean.y[k], y_range, log_y, height));
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

std::string legend_html(const PlotSpec& spec) {
  const std::vector<std::size_t> colours = colours_of(spec);
  std::string html;
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const Series& series = spec.series[k];
    if (series.label.empty()) continue;
    const char* shape = series.style == Style::kDashed   ? "dash"
                        : series.style == Style::kPoints ? "dot"
                        : series.style == Style::kBand   ? "band"
                        : series.style == Style::kBars   ? "bar"
                                                         : "line";
    html += fmt::format("<span class=\"key\"><i class=\"{}\" style=\"--k:var({})\"></i>{}</span>", shape,
                        kPalette[colours[k]].variable, escape_html(series.label));
  }
  return html;
}

std::string render_plot(const PlotSpec& spec) {
  const Drawing drawing = draw_svg(spec);
  if (!drawing.error.empty()) return not_drawn(spec, drawing.error);
  const std::string label = escape_html(spec.title.empty() ? spec.y_label : spec.title);
  if (drawing.body.size() <= kMaxSvgBytes) {
    return fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n{}</svg>\n", spec.width,
                       spec.height, label, drawing.body);
  }
  const std::string png = draw_png(spec);
  if (png.empty()) return not_drawn(spec, "gnuplot could not draw it as a picture");
  return fmt::format("<img class=\"raster\" alt=\"{}\" src=\"data:image/png;base64,{}\">\n", label,
                     base64(png));
}

bool write_svg(const PlotSpec& spec, const std::string& path) {
  const Drawing drawing = draw_svg(spec);
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
  constexpr int kHead = 44;
  host::write_file_atomically(
      path, fmt::format(
                "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
                "viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" font-family=\"sans-serif\" "
                "font-size=\"12\" fill=\"#24292f\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n"
                "<text x=\"12\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{2}</text>\n{3}"
                "<g transform=\"translate(0,{4})\">\n{5}</g>\n</svg>\n",
                spec.width, spec.height + kHead, escape_html(spec.title), legend, kHead, drawing.body));
  return true;
}

}  // namespace heft::report
