/// @file
/// gnuplot's SVG file made into a fragment of a page.
#pragma once

#include <cstddef>
#include <string>

namespace heft::page {

/// In the script each colour is written as rgb(1, 0, entry of the palette), which compact_svg replaces by its CSS variable.
std::string placeholder(std::size_t entry);

/// gnuplot's SVG file made into a small fragment: no XML heading, no definitions, no empty groups, points
/// of one colour as one path.
/// @param svg  drawn with the colours of placeholder(); black becomes ink
std::string compact_svg(const std::string& svg);

/// Replaces every occurrence in a text.
void replace_all(std::string& text, const std::string& what, const std::string& with);

}  // namespace heft::page
