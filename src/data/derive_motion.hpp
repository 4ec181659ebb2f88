/// @file
/// Velocity and acceleration on an even grid, the same for a whole log and for pieces of one.
#pragma once

#include <string>

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"

namespace heft::data {

/// The message for logs too short to derive anything from.
[[noreturn]] void refuse_short_log(const std::string& path, long samples);

/// Fewest samples that velocity and acceleration are derived from.
inline constexpr int kLeastSamples = 5;

/// Smoothed position, velocity and acceleration on an even grid.
struct DerivedMotion {
  Eigen::MatrixXd q, qd, qdd;
};
DerivedMotion derive_on_grid(const Eigen::VectorXd& grid, const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate,
                             double cutoff, const MotionOptions& options);
/// Its velocity alone.
Eigen::MatrixXd velocity_on_grid(const Eigen::VectorXd& grid, const Eigen::Ref<const Eigen::MatrixXd>& q, double sample_rate, double cutoff,
                                 const MotionOptions& options);

/// Rows at the edge of a piece that differ from those of the whole log by more than 1e-12.
Eigen::Index settling_rows(double sample_rate, double cutoff, const MotionOptions& options);

}  // namespace heft::data
