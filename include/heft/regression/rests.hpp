/// @file
/// Where a joint rests between two motions: friction holds it there, and takes up any torque below its level.
#pragma once

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/model/motion_torque.hpp"

namespace heft::regression {

/// A joint rests where it is no faster than model::kRestSpeed, or a slide no faster than kSlideRestSpeed, for kRestSeconds or
/// longer: one that turns back, or crawls, does not.
inline constexpr double kSlideRestSpeed = 2e-3;  ///< [m/s]
inline constexpr double kRestSeconds = 0.35;     ///< [s]

/// Whether a joint moves at all in a log: what a log says of one that does not, it says at rest.
/// @param joint  counted from 0
bool moves(const data::StreamSummary& log, Eigen::Index joint, bool prismatic);

/// Rows in which a joint rests.
/// @param qd           m rows of its velocity, evenly spaced [rad/s, m/s]
/// @param sample_rate  of these rows [Hz]
/// @return m
Eigen::Array<bool, Eigen::Dynamic, 1> resting_rows(const Eigen::Ref<const Eigen::VectorXd>& qd, double sample_rate,
                                                   bool prismatic);

}  // namespace heft::regression
