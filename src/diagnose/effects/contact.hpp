/// @file
/// Stretches of time whose residual is one force at the tool.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "../candidates.hpp"

namespace heft::diagnose {

/// Running sums over short bins of a log, so that the force of any stretch of bins costs as much as that of another.
/// The residual of an outer force F is r = -Jᵀ F.
struct ForceSums {
  double seconds{0.0};                  ///< length of a bin
  std::vector<Eigen::Matrix3d> normal;  ///< Σ J w Jᵀ of the bins before each, and of all: bins + 1
  std::vector<Eigen::Vector3d> right;   ///< the same of -J w r
  std::vector<double> power;  ///< the same of w (Σ r)² / rows: most that any force of a bin could explain
  std::vector<double> joints;  ///< the same of how many joints move
  std::vector<double> rows{};  ///< the same of rows that count, all joints, in parts of a joint's rows of a bin; empty: all do
  Eigen::Index bins() const { return static_cast<Eigen::Index>(normal.size()) - 1; }
};

/// A stretch of bins and the force that explains most of it.
struct Touch {
  Eigen::Index first{0}, count{0};  ///< bins
  Eigen::Vector3d force{Eigen::Vector3d::Zero()};
  Eigen::Vector3d std{
      Eigen::Vector3d::Zero()};  ///< of the force, for residuals correlated as elsewhere in the log
  double gain{0.0};              ///< fall of the weighted squared error
  double share{0.0};             ///< of what a force in every bin of its own could explain
  double scale{1.0};      ///< median gain of stretches of this length against that of white noise, at least 1
  double statistic{0.0};  ///< gain / scale: chi-square with three degrees where there is no touch
  double p_value{1.0};    ///< that the best of all stretches tried reaches it by chance
};

/// The best stretch of 0.26 to 1.2 s that does not overlap those taken; count 0 where there is none.
///
/// A stretch that holds no touch gives a gain of scale times a chi-square with three degrees, where scale counts what
/// correlation adds to sums over that length: it is the median gain of all stretches of the length over 2.37, the
/// median of that chi-square. The median of B independent gains is as good as 1.58 B degrees of freedom: its relative
/// variance 1 / (4 B f(m)² m²) = 1.264 / B, with the density f(m) = 0.188 at m = 2.366, is 2 / 1.58 B. So
/// statistic / 3 follows F(3, 1.58 B), with B stretches that do not overlap; p is its tail times the stretches tried
/// (Bonferroni, which overlaps make too large).
Touch best_touch(const ForceSums& sums, const std::vector<std::pair<Eigen::Index, Eigen::Index>>& taken);

/// Adds the touches of one contact to those of another.
void add_touches(const Candidate& more, Candidate& contact);

}  // namespace heft::diagnose
