/// @file
/// Scripts drawn by gnuplot, as part of a page or as a file of their own.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

namespace heft::page {

/// How an entry of the palette is written in a script.
using ColourName = std::string (*)(std::size_t entry);
/// The script after `set terminal`, with colours named by a function.
using Script = std::function<std::string(ColourName)>;

/// Where the axes are in a drawing, from its upper left corner [px].
struct Frame {
  double left{0.0}, right{0.0}, top{0.0}, bottom{0.0};
};

struct Drawing {
  std::string body;  ///< inside <svg>
  std::string error;
  std::optional<Frame> frame{};  ///< none: gnuplot did not say
};

/// Text as gnuplot's single-quoted string, in which nothing is expanded or executed. gnuplot reads a doubled
/// quote at the beginning as an empty string and goes on with the rest as commands, so an apostrophe becomes
/// a typographic one, which has no meaning to it.
std::string quote(const std::string& text);

/// @param width, height  [px]
Drawing draw_svg(int width, int height, const Script& script);

/// Whether a drawing is so large that a picture of it is shown faster.
bool is_dense(const Drawing& drawing);

/// Fragment of a page: the drawing, or a picture of it when it is dense, or why there is none.
/// @param label   what a screen reader says instead of the drawing
/// @param data    of plot_data(), for the page's script; may be empty
/// @param points  of series_points(), from which the script tells values of a picture; may be empty
std::string fragment(const Drawing& drawing, const std::string& title, const std::string& label, int width,
                     int height, const Script& script, const std::string& data, const std::string& points);

/// A file of its own: title, then `legend`, then the drawing.
void write_standalone(const Drawing& drawing, const std::string& title, const std::string& legend, int width,
                      int height, const std::string& path);

}  // namespace heft::page
