/// @file
/// Rotations that simulator and collision check share.
#pragma once

#include <Eigen/Core>

namespace heft {

/// The rotation that takes (0, 0, 1) to a direction by the shortest way; half a turn about x where it is (0, 0, -1).
/// @param direction  of any length but zero
Eigen::Matrix3d rotation_from_z(const Eigen::Vector3d& direction);

}  // namespace heft
