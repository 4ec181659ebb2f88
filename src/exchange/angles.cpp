#include "angles.hpp"

#include <cmath>

#include <Eigen/Geometry>

namespace heft::exchange {

Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& rotation) {
  // One turn after the other is taken off, so that what rounding makes of an undetermined yaw is in roll as well.
  const double yaw = std::atan2(rotation(1, 0), rotation(0, 0));
  const Eigen::Matrix3d without_yaw =
      Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * rotation;
  const double pitch = std::atan2(-without_yaw(2, 0), without_yaw(0, 0));
  const Eigen::Matrix3d rest =
      Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()).toRotationMatrix() * without_yaw;
  return {std::atan2(rest(2, 1), rest(2, 2)), pitch, yaw};
}

}  // namespace heft::exchange
