#include "heft/page/plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <unordered_set>

#include <fmt/format.h>

#include "gnuplot.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "heft/page/page.hpp"
#include "level_outline.hpp"
#include "palette.hpp"

namespace heft::page {
namespace {

constexpr std::size_t kMaxSvgBytes = 300 * 1024;

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

/// In the SVG each colour is written first as rgb(1, 0, index), to be replaced by its CSS variable afterwards.
std::string placeholder(std::size_t colour) { return fmt::format("#0100{:02x}", colour); }
std::string solid(std::size_t colour) { return kPalette[colour].light; }

/// Series with two heights at each x.
bool has_high(Style style) { return style == Style::kBand || style == Style::kIntervals; }

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
  const bool two = has_high(series.style);
  const std::size_t size = std::min(series.x.size(), series.y.size());
  for (std::size_t k = 0; k < size; ++k) {
    const bool finite = std::isfinite(series.x[k]) && std::isfinite(series.y[k]) &&
                        (!two || (k < series.y_high.size() && std::isfinite(series.y_high[k])));
    if (!finite) {
      text += "\n";  // an empty line breaks the curve
    } else if (two) {
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
  Extent extent = extent_of(spec);
  if (spec.equal_axes) {  // a square, so that no side is squeezed
    const double half = 0.53 * std::max(extent.x.high - extent.x.low, extent.y.high - extent.y.low);
    for (Range* range : {&extent.x, &extent.y}) {
      const double middle = 0.5 * (range->low + range->high);
      *range = {middle - half, middle + half};
    }
  }
  const bool has_bars = num_bars > 0;
  const bool has_categories = has_bars || !spec.categories.empty();

  std::string s;
  s += "set encoding utf8\nunset key\n";
  s += fmt::format("set border 3 lc rgb '{}' lw 1\nset tics nomirror out scale 0.5\n", colour(kInk));
  s += fmt::format("set grid ytics {} lt 1 lc rgb '{}' lw 1\n", has_categories ? "" : "xtics", colour(kGrid));
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
  if (has_bars) s += fmt::format("set boxwidth {:.6g}\n", 0.8 / num_bars);
  if (has_categories) {
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
    const Range y = spec.equal_axes ? extent.y : padded(extent.y, spec.log_y, has_bars);
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
      case Style::kDots: how = fmt::format("points pt 7 ps 0.65 lc rgb '{}'", tint); break;
      case Style::kIntervals: how = fmt::format("vectors nohead lw 3 lc rgb '{}'", tint); break;
      case Style::kBand:
        how = fmt::format("filledcurves fs transparent solid 0.2 noborder lc rgb '{}'", tint);
        break;
      case Style::kBars: how = fmt::format("boxes fs solid 0.9 noborder lc rgb '{}'", tint); break;
    }
    plot += fmt::format("{}$d{} using {} with {} title {}", k ? ", " : "", k,
                        thin.style == Style::kBand        ? "1:2:3"
                        : thin.style == Style::kIntervals ? "1:2:(0):($3-$2)"
                                                          : "1:2",
                        how, quote(thin.label));
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
  double point_size = 0.0;
  std::string point_path;
  const auto flush_points = [&] {
    if (point_path.empty()) return;
    out += fmt::format(
        "<path fill='none' stroke='{}' stroke-width='{:.1f}' stroke-linecap='round' stroke-opacity='0.75' "
        "d='{}'/>\n",
        point_colour, point_size, point_path);
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
      double x = 0, y = 0, scale = 0;
      if (std::sscanf(attribute(line, "transform").c_str(), "translate(%lf,%lf) scale(%lf)", &x, &y,
                      &scale) == 3) {
        const double size = scale / 1.35 * 3.6;  // 1.35 is the scale of points of size 0.3
        if (colour != point_colour || size != point_size) flush_points();
        point_colour = colour;
        point_size = size;
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
    const bool drawn = line.rfind("<path", 0) == 0 || line.rfind("<polygon", 0) == 0 || line[0] == 'L' ||
                       std::isdigit(static_cast<unsigned char>(line[0]));  // or goes on from the line before
    out += (drawn ? with_short_numbers(line) : line) + '\n';
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

/// Script after `set terminal` with the colours that a function gives to the entries of the palette.
using Script = std::function<std::string(std::string (*colour)(std::size_t))>;

Drawing draw_svg(int width, int height, const Script& script) {
  const GnuplotResult result =
      run_gnuplot(fmt::format("set terminal svg size {},{} dynamic noenhanced rounded font 'sans-serif,12'\n",
                              width, height) +
                  script(placeholder));
  if (!result.ok) return {{}, result.error};
  return {compact(result.output), {}};
}

Drawing draw_svg(const PlotSpec& spec) {
  const Extent extent = extent_of(spec);
  if (extent.x.empty() || extent.y.empty()) return {{}, "nothing to draw: no finite value"};
  return draw_svg(spec.width, spec.height, [&](auto colour) { return script_of(spec, colour); });
}

std::string draw_png(int width, int height, const Script& script) {
  const GnuplotResult result = run_gnuplot(fmt::format("set terminal pngcairo size {},{} noenhanced rounded "
                                                       "fontscale 1.6 linewidth 1.6 background '#ffffff'\n",
                                                       2 * width, 2 * height) +
                                           script(solid));
  return result.ok ? result.output : std::string{};
}

std::string not_drawn(const std::string& title, const std::string& reason) {
  return fmt::format("<p class=\"noplot\">{} is not drawn: {}.</p>\n",
                     title.empty() ? "The plot" : "“" + escape_html(title) + "”", escape_html(reason));
}

/// Fragment of a page: the drawing, or as a picture when it is large, or why there is none.
std::string fragment(const Drawing& drawing, const std::string& title, const std::string& label, int width,
                     int height, const Script& script) {
  if (!drawing.error.empty()) return not_drawn(title, drawing.error);
  if (drawing.body.size() <= kMaxSvgBytes) {
    return fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n{}</svg>\n", width,
                       height, escape_html(label), drawing.body);
  }
  const std::string png = draw_png(width, height, script);
  if (png.empty()) return not_drawn(title, "gnuplot could not draw it as a picture");
  return fmt::format("<img class=\"raster\" alt=\"{}\" src=\"data:image/png;base64,{}\">\n",
                     escape_html(label), base64(png));
}

/// A file of its own: title, then `legend`, then the drawing.
void write_standalone(const Drawing& drawing, const std::string& title, const std::string& legend, int width,
                      int height, const std::string& path) {
  constexpr int kHead = 44;
  host::write_file_atomically(
      path, fmt::format(
                "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
                "viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" font-family=\"sans-serif\" "
                "font-size=\"12\" fill=\"#24292f\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n"
                "<text x=\"12\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{2}</text>\n{3}"
                "<g transform=\"translate(0,{4})\">\n{5}</g>\n</svg>\n",
                width, height + kHead, escape_html(title), legend, kHead, drawing.body));
}

/// Colour of a part of the way from low to high, 0..1: evenly growing lightness (in Oklab), so that equal steps of the
/// value look like equal steps, also without colour.
std::string level_colour(double part) {
  // B. Ottosson, A perceptual color space for image processing: lightness, and two coordinates of hue and chroma.
  const double lightness = 0.30 + 0.62 * part;
  const double hue = (280.0 - 180.0 * part) * 3.14159265358979 / 180.0;  // violet blue to yellow
  const double chroma = 0.10 + 0.05 * part;
  const double a = chroma * std::cos(hue), b = chroma * std::sin(hue);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3.0);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3.0);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3.0);
  const std::array<double, 3> linear{4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                                     -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                                     -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
  std::string text = "#";
  for (double c : linear) {
    c = std::clamp(c, 0.0, 1.0);
    c = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
    text += fmt::format("{:02x}", static_cast<int>(std::lround(255.0 * c)));
  }
  return text;
}

/// The whole script of a map after `set terminal`.
std::string script_of(const MapSpec& spec, std::string (*colour)(std::size_t)) {
  const std::string ink = "#101418", paper = "#ffffff";  // on the colours, which are the same on any ground
  const std::size_t count = spec.levels.size() + 1;
  const auto tint = [&](std::size_t k) {
    return level_colour(count > 1 ? static_cast<double>(k) / static_cast<double>(count - 1) : 0.0);
  };
  const double width = spec.x.back() - spec.x.front();

  std::string s = "set encoding utf8\nunset key\n";
  s += fmt::format("set border 15 lc rgb '{}' lw 1\nset tics nomirror out scale 0.5\n", colour(kInk));
  s += "set format y '%.6g'\nset format x '%.6g'\nset tmargin 1.7\nset rmargin 13\n";
  s += fmt::format("set bmargin {}\n", spec.x_label.empty() ? "1.5" : "2.8");
  s += fmt::format("set xrange [{:.9g}:{:.9g}]\nset yrange [{:.9g}:{:.9g}]\n", spec.x.front(), spec.x.back(),
                   spec.y.front(), spec.y.back());
  if (spec.x_tics > 0.0) s += fmt::format("set xtics {:.6g}\n", spec.x_tics);
  if (spec.y_tics > 0.0) s += fmt::format("set ytics {:.6g}\n", spec.y_tics);
  if (!spec.x_label.empty()) s += fmt::format("set xlabel {} offset 0,0.3\n", quote(spec.x_label));
  if (!spec.y_label.empty()) {
    s += fmt::format("set label {} at graph 0, graph 1 left offset -3,0.8\n", quote(spec.y_label));
  }
  // Key of colours.
  if (!spec.value_label.empty()) {
    s += fmt::format("set label {} at graph 1.02, graph 1 left offset 0,0.8\n", quote(spec.value_label));
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double low = static_cast<double>(k) / static_cast<double>(count);
    s += fmt::format(
        "set object rect from graph 1.025, graph {:.6g} to graph 1.05, graph {:.6g} noclip fc rgb '{}' fs "
        "solid "
        "noborder\n",
        low, low + 1.0 / static_cast<double>(count), tint(k));
    if (k > 0) {
      s += fmt::format("set label {} at graph 1.058, graph {:.6g} left\n",
                       quote(fmt::format("{:.4g}", spec.levels[k - 1])), low);
    }
  }
  for (const MapSpec::Frame& f : spec.frames) {
    s += fmt::format(
        "set object rect from first {:.9g}, first {:.9g} to first {:.9g}, first {:.9g} front fs empty border "
        "lc rgb '{}' lw 1.8 {}\n",
        f.x_low, f.y_low, f.x_high, f.y_high, ink, f.dashed ? "dt (6,4)" : "");
    s += fmt::format("set label {} at first {:.9g}, first {:.9g} left offset 0.6,-0.8 tc rgb '{}' front\n",
                     quote(f.label), f.x_low, f.y_high, ink);
  }
  // A disc is as many pixels wide as high: its radius counts along x.
  const double radius = 8.5 * width / std::max(1.0, 0.80 * spec.width);
  for (const MapSpec::Place& p : spec.places) {
    s += fmt::format(
        "set object circle at first {:.9g}, first {:.9g} size first {:.6g} front fc rgb '{}' fs solid border "
        "rgb '{}'\n",
        p.x, p.y, radius, paper, ink);
    s += fmt::format("set label {} at first {:.9g}, first {:.9g} center tc rgb '{}' front\n", quote(p.label),
                     p.x, p.y, ink);
  }

  // What is not above the first level, then each level over the one before.
  s += fmt::format("$d0 << EOD\n{0:.9g} {1:.9g}\n{2:.9g} {1:.9g}\n{2:.9g} {3:.9g}\n{0:.9g} {3:.9g}\nEOD\n",
                   spec.x.front(), spec.y.front(), spec.x.back(), spec.y.back());
  std::string plot =
      fmt::format("plot $d0 using 1:2 with filledcurves closed fs solid noborder lc rgb '{}'", tint(0));
  for (std::size_t k = 1; k < count; ++k) {
    const std::vector<Outline> outlines = level_outlines(spec.x, spec.y, spec.values, spec.levels[k - 1]);
    if (outlines.empty()) continue;
    // One line through all outlines, back to where it began after each: what is walked to and fro encloses nothing,
    // and holes, which run the other way round, stay empty.
    s += fmt::format("$d{} << EOD\n", k);
    const auto add = [&](const std::array<double, 2>& p) { s += fmt::format("{:.6g} {:.6g}\n", p[0], p[1]); };
    for (const Outline& outline : outlines) {
      for (const auto& p : outline) add(p);
      add(outline.front());
      add(outlines.front().front());
    }
    s += "EOD\n";
    plot +=
        fmt::format(", $d{} using 1:2 with filledcurves closed fs solid noborder lc rgb '{}'", k, tint(k));
  }
  return s + plot + "\n";
}

Drawing draw_svg(const MapSpec& spec) {
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
  return fragment(draw_svg(spec), spec.title, spec.title.empty() ? spec.y_label : spec.title, spec.width,
                  spec.height, [&](auto colour) { return script_of(spec, colour); });
}

std::string render_plot(const MapSpec& spec) {
  return fragment(draw_svg(spec), spec.title, spec.title.empty() ? spec.value_label : spec.title, spec.width,
                  spec.height, [&](auto colour) { return script_of(spec, colour); });
}

bool write_svg(const MapSpec& spec, const std::string& path) {
  const Drawing drawing = draw_svg(spec);
  if (!drawing.error.empty()) return false;
  write_standalone(drawing, spec.title, {}, spec.width, spec.height, path);
  return true;
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
  write_standalone(drawing, spec.title, legend, spec.width, spec.height, path);
  return true;
}

}  // namespace heft::page
