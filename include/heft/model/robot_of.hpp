/// @file
/// A compile-time arm as a robot.
#pragma once

#include <cstddef>
#include <string>

#include "heft/core/arm_model.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// The arm with made-up names: base, joint1.., link1.. Limits are none.
template <int N>
Robot robot_of(const ArmModel<double, N>& arm, const std::string& name) {
  Robot robot;
  robot.name = name;
  robot.base_link = "base";
  robot.tip_link = "link" + std::to_string(N);
  robot.gravity = arm.gravity;
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    RobotJoint joint;
    joint.name = "joint" + std::to_string(i + 1);
    joint.link_name = "link" + std::to_string(i + 1);
    joint.joint = arm.joints[i];
    joint.link = arm.links[i];
    joint.actuation = arm.actuation[i];
    robot.joints.push_back(joint);
  }
  return robot;
}

}  // namespace heft::model
