/// @file
/// The gnuplot script of a plot.
#pragma once

#include <string>
#include <vector>

#include "drawing.hpp"
#include "extent.hpp"
#include "heft/page/plot.hpp"

namespace heft::page {

/// Palette entry of each series; kAuto takes the hues from blue on in turn.
std::vector<std::size_t> colours_of(const PlotSpec& spec);

/// What the axes of the drawing go from and to.
/// @param spec  has_values()
Extent extent_shown(const PlotSpec& spec);

/// False when the plot holds no value that can be shown.
bool has_values(const PlotSpec& spec);

/// The whole script after `set terminal`.
std::string script_of(const PlotSpec& spec, ColourName colour);

}  // namespace heft::page
