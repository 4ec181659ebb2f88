/// @file
/// A robot as a model file of a simulator, with a list of what that simulator cannot express.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "heft/model/robot.hpp"

namespace heft::exchange {

/// A form in which a robot can be written.
struct RobotFormat {
  std::string_view id;     ///< "mjcf"
  std::string_view title;  ///< "MuJoCo's MJCF"
};

/// Every form, in the order of the documents.
std::span<const RobotFormat> robot_formats();

/// Something of a robot that a form has no place for.
struct LeftOut {
  std::string
      what;  ///< id of an effect, or rotor_inertia, friction_offset, gear_coupling, elasticity, delay, gravity
  int joint{-1};  ///< from 0; -1: of the whole arm
  /// Its torque in parts of the joint's (of the arm: of the joint where it matters most), root mean square over a motion
  /// through half of the joint's range at a third of its top speed [1]; NaN where that says nothing.
  double share{0.0};
};

struct RobotText {
  std::string text;
  std::vector<LeftOut> left_out;
};

/// The robot as text of one of these forms: links with inertia, joints with axis, limits, Coulomb and viscous friction;
/// armature (mjcf) and a spring (mjcf, sdf) where the form has them. No shapes: it is a model of the dynamics.
/// Numbers read back as the same double. Angles are in radians, and the text says so where the form has a choice.
/// @throws InputError for a format that does not exist; ModelError when a link's parameters are physically impossible, a
///         friction or rotor inertia is negative, or a number is not finite
RobotText to_text(const model::Robot& robot, std::string_view format);

}  // namespace heft::exchange
