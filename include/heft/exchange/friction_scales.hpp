/// @file
/// A robot's friction in parts of what its controller compensates for.
#pragma once

#include <string>
#include <vector>

#include "heft/exchange/robot_formats.hpp"
#include "heft/model/robot.hpp"

namespace heft::exchange {

/// Friction of each joint over the controller's own [1], not limited to what the controller takes.
struct FrictionScales {
  std::vector<double> viscous, coulomb;
};

/// @param robot       the arm as measured
/// @param controller  the same arm with the friction that the controller adds to its target torque at scale 1, such as a model
///                    fitted to its target current
/// @throws ModelError when the two have other joints, the controller's friction of a joint is not above zero, the robot's is
///         below zero or not finite, no joint of the robot has any, or all have the controller's to the last digit
FrictionScales friction_scales(const model::Robot& robot, const model::Robot& controller);

/// The scales for Universal Robots' URScript direct_torque(torque, viscous_scale, coulomb_scale) (PolyScope 5.25.1, PolyScope X
/// 10.12.1 and later) and ur_msgs/FrictionModelParameters, each limited to 0..1; and the friction that scales cannot express.
/// @throws ModelError as friction_scales(), and for an arm that has not six joints
RobotText ur_friction_scales(const model::Robot& robot, const model::Robot& controller);

/// "ur-friction".
RobotFormat friction_scales_format();

}  // namespace heft::exchange
