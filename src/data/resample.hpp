/// @file
/// Even grids, and values brought to them the same way for a whole log and for pieces of one.
#pragma once

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"

namespace heft::data {

/// Longest stretch without samples that a spline may bridge, in median periods.
inline constexpr double kGapFactor = 10.0;

/// How a signal goes on in a gap: along the straight line, or, of positions, with the velocities that it has at both ends, so
/// that a filter finds no corner there and has little to carry beside the gap.
enum class Bridge { kLine, kMotion };

/// `resample` with the longest bridged stretch given [s], so that a piece of a log has the gaps of the whole.
Eigen::MatrixXd resample(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal,
                         const Eigen::VectorXd& at, double longest, Bridge bridge = Bridge::kLine);

/// Number of rows of the even grid over `length` seconds at about `sample_rate`.
Eigen::Index grid_rows(double length, double sample_rate);

/// The even grid from the first to the last time stamp.
Eigen::VectorXd even_grid(const Eigen::VectorXd& time, double sample_rate);

}  // namespace heft::data
