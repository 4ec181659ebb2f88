/// @file
/// The gnuplot script of a map.
#pragma once

#include <string>

#include "drawing.hpp"
#include "heft/page/plot.hpp"

namespace heft::page {

/// Colour of the k-th of `count` levels, the lowest first: "#rrggbb".
std::string level_tint(std::size_t k, std::size_t count);

/// The whole script after `set terminal`.
/// @param spec  at least two values along each side, and one for each pair of them
std::string script_of(const MapSpec& spec, ColourName colour);

}  // namespace heft::page
