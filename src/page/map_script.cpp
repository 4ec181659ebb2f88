#include "map_script.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "level_outline.hpp"
#include "palette.hpp"

namespace heft::page {
namespace {

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

/// Colours between the levels, one more than there are levels.
std::size_t num_colours(const MapSpec& spec) { return spec.levels.size() + 1; }

std::string axes_script(const MapSpec& spec, ColourName colour) {
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
  return s;
}

/// The key of colours at the right.
std::string key_script(const MapSpec& spec) {
  const std::size_t count = num_colours(spec);
  std::string s;
  if (!spec.value_label.empty()) {
    s += fmt::format("set label {} at graph 1.02, graph 1 left offset 0,0.8\n", quote(spec.value_label));
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double low = static_cast<double>(k) / static_cast<double>(count);
    s += fmt::format(
        "set object rect from graph 1.025, graph {:.6g} to graph 1.05, graph {:.6g} noclip fc rgb '{}' fs "
        "solid noborder\n",
        low, low + 1.0 / static_cast<double>(count), level_tint(k, count));
    if (k > 0) {
      s += fmt::format("set label {} at graph 1.058, graph {:.6g} left\n",
                       quote(fmt::format("{:.4g}", spec.levels[k - 1])), low);
    }
  }
  return s;
}

/// Frames and places over the colours.
std::string annotation_script(const MapSpec& spec) {
  const std::string ink = "#101418", paper = "#ffffff";  // on the colours, which are the same on any ground
  const double width = spec.x.back() - spec.x.front();
  std::string s;
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
  return s;
}

/// The filled levels and the `plot` command.
std::string level_script(const MapSpec& spec) {
  const std::size_t count = num_colours(spec);
  std::string s;
  // The colour below the first level everywhere, then each level over the one before.
  s += fmt::format("$d0 << EOD\n{0:.9g} {1:.9g}\n{2:.9g} {1:.9g}\n{2:.9g} {3:.9g}\n{0:.9g} {3:.9g}\nEOD\n",
                   spec.x.front(), spec.y.front(), spec.x.back(), spec.y.back());
  std::string plot = fmt::format("plot $d0 using 1:2 with filledcurves closed fs solid noborder lc rgb '{}'",
                                 level_tint(0, count));
  for (std::size_t k = 1; k < count; ++k) {
    const std::vector<Outline> outlines = level_outlines(spec.x, spec.y, spec.values, spec.levels[k - 1]);
    if (outlines.empty()) continue;
    // One line through all outlines, back to its first point after each: what is drawn there and back encloses no
    // area, and holes, which run the other way round, stay empty.
    s += fmt::format("$d{} << EOD\n", k);
    const auto add = [&](const std::array<double, 2>& p) { s += fmt::format("{:.6g} {:.6g}\n", p[0], p[1]); };
    for (const Outline& outline : outlines) {
      for (const auto& p : outline) add(p);
      add(outline.front());
      add(outlines.front().front());
    }
    s += "EOD\n";
    plot += fmt::format(", $d{} using 1:2 with filledcurves closed fs solid noborder lc rgb '{}'", k,
                        level_tint(k, count));
  }
  return s + plot + "\n";
}

}  // namespace

std::string level_tint(std::size_t k, std::size_t count) {
  return level_colour(count > 1 ? static_cast<double>(k) / static_cast<double>(count - 1) : 0.0);
}

std::string script_of(const MapSpec& spec, ColourName colour) {
  return axes_script(spec, colour) + key_script(spec) + annotation_script(spec) + level_script(spec);
}

}  // namespace heft::page
