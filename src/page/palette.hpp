/// @file
/// The report's colours, one table for the page's style sheet, the SVG drawings and the PNG fallback.
#pragma once

#include <array>
#include <cstddef>

namespace heft::page {

/// A role of a colour, its CSS variable and its value on light and on dark ground.
struct Colour {
  const char* variable;
  const char* light;
  const char* dark;
};

/// Okabe and Ito's colours, lightened for dark ground. Order: ink, grid, mark, then the hues in the order of Hue
/// from kNeutral on.
inline constexpr std::array<Colour, 10> kPalette{{
    {"--ink", "#24292f", "#d7dde4"},
    {"--grid", "#dfe3e8", "#30363d"},
    {"--mark", "#6e7781", "#8b949e"},
    {"--c-neutral", "#8c959f", "#7d8590"},
    {"--c-blue", "#0072b2", "#4ea8de"},
    {"--c-vermillion", "#d55e00", "#ff8c4b"},
    {"--c-green", "#009e73", "#34c79a"},
    {"--c-purple", "#b0578f", "#e39bc6"},
    {"--c-sky", "#56b4e9", "#a5d8f6"},
    {"--c-orange", "#c98a00", "#f5be41"},
}};

inline constexpr std::size_t kInk = 0;
inline constexpr std::size_t kGrid = 1;
inline constexpr std::size_t kMark = 2;
inline constexpr std::size_t kFirstHue = 3;

}  // namespace heft::page
