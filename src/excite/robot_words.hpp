/// @file
/// Small things about robots that the files of this room share.
#pragma once

#include <array>
#include <string>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::excite {

inline const model::RobotJoint& joint_of(const model::Robot& robot, Eigen::Index j) {
  return robot.joints[static_cast<std::size_t>(j)];
}

inline std::string joint_name(const model::Robot& robot, Eigen::Index j) {
  return fmt::format("joint {} ({})", j + 1, joint_of(robot, j).name);
}

inline Eigen::Matrix3d matrix_of(const std::array<double, 9>& m) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
inline Eigen::Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

}  // namespace heft::excite
