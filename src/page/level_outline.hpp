/// @file
/// Outlines of the places where a quantity on a grid is at or above a level.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace heft::page {

/// A closed line, the region on its left; the last point is followed by the first. Holes run the other way round.
using Outline = std::vector<std::array<double, 2>>;

/// Outlines of {values >= level}, with linear interpolation between grid points; where the region meets the grid's
/// border the outline follows the border. A value that is not finite is below every level.
/// @param x, y    ascending
/// @param values  x.size() × y.size()
std::vector<Outline> level_outlines(const std::vector<double>& x, const std::vector<double>& y,
                                    const Eigen::MatrixXd& values, double level);

}  // namespace heft::page
