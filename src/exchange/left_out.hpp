/// @file
/// What a form has no place for, and how much torque that is.
#pragma once

#include <vector>

#include "heft/exchange/robot_formats.hpp"

namespace heft::exchange {

/// What a form can express beyond rigid bodies, Coulomb and viscous friction.
struct Places {
  bool rotor_inertia{false};
  bool spring{false};
  bool gravity{false};
};

/// Everything of the robot that has no place there, effects in the robot's order.
std::vector<LeftOut> left_out(const model::Robot& robot, const Places& places);

/// Stiffness and rest position of the springs of a joint together; stiffness 0: it has none.
struct JointSpring {
  double stiffness{0.0};  ///< [N·m/rad, N/m]
  double rest{0.0};       ///< [rad, m]
};
JointSpring spring_of(const model::Robot& robot, int joint);

/// Rotor inertia of a joint, that of effects in it [kg·m², kg].
double rotor_inertia_of(const model::Robot& robot, int joint);

}  // namespace heft::exchange
