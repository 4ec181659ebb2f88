/// @file
/// A rotation as three angles.
#pragma once

#include <Eigen/Core>

namespace heft::exchange {

/// roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll): rpy of URDF and SDF, and C, B, A of KUKA. Exact also where
/// the pitch is a right angle and roll and yaw are not unique.
Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& rotation);

}  // namespace heft::exchange
