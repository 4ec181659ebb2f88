/// @file
/// The fastest motion through intervals whose limits are lines in ṡ² and s̈.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace heft::retime {

/// u·s̈ + x·ṡ² ≤ bound, ṡ² at the beginning of an interval. Scaled so that coefficients of one row are comparable.
struct Line {
  double u{0.0}, x{0.0}, bound{0.0};
};

/// From low to high; empty when low > high.
struct Range {
  double low{0.0}, high{0.0};
  bool empty() const { return !(low <= high); }
};

/// The ṡ² in [0, most] for which some s̈ satisfies all lines. `most` is finite. Cost: a few passes over the lines.
Range speeds(const std::vector<Line>& lines, double most);
/// The s̈ that satisfy all lines at that ṡ²; infinite where nothing bounds it.
Range accelerations(const std::vector<Line>& lines, double x);

/// Limits of a path cut into k intervals.
struct Intervals {
  Eigen::VectorXd s;                     ///< places, k + 1
  std::vector<std::vector<Line>> lines;  ///< k: with constant s̈ in the interval
  Eigen::VectorXd most;                  ///< largest ṡ² at each place, k + 1
};

/// A motion from rest to rest.
struct Sweep {
  Eigen::VectorXd x;         ///< ṡ² at each place, k + 1
  Eigen::VectorXd u;         ///< s̈ in each interval, k
  Eigen::VectorXd highest;   ///< largest ṡ² from which the end can be reached, k + 1
  double duration{0.0};      ///< [s]
  Eigen::Index stopped{-1};  ///< place that no motion passes; −1: none, the motion is complete
};

/// Controllable sets backward from rest, then the largest s̈ that stays in them forward from rest.
Sweep sweep(const Intervals& path);

}  // namespace heft::retime
