/// @file
/// Where the torque of a log was measured decides what of a robot is in it.
///
/// | part of a robot | torque of the motors | of a sensor behind the gears |
/// | --- | --- | --- |
/// | rigid bodies; springs of elastic joints | yes | yes |
/// | rotor inertia, friction of the gears, gear couplings, joint effects, delay of the drives' channel | yes | no |
/// | `friction_offset` of a model fitted to motors, or of a URDF: friction that differs between the directions, zero error of a current | yes | no: both arise before the sensor |
/// | `friction_offset` and whatever else a model fitted to such sensors holds: the sensor's zero error, friction of what lies behind it | unknown | yes |
#pragma once

#include <string>
#include <vector>

#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// A robot known from its motors, as a sensor behind the gears sees it: without rotor inertia, friction and its offset,
/// couplings, joint effects and the delay of the drives' channel; an elastic joint keeps its spring and loses the motor's
/// inertia.
Robot at_sensor(Robot robot);

/// The robot whose joint torque (MotionTorque) is what a log holds. Behind the gears that is at_sensor() of a model of the
/// motors; a model fitted to such a sensor is returned as it is: it holds nothing but what the sensor showed.
/// @param behind_gears  the log's torque comes from a sensor behind the gears
/// @param fit    of the model file that the robot's parameters come from; null: they come from a URDF
/// @param notes  gets a line when the model lacks what a motor's torque holds; may be null
Robot as_measured(const Robot& robot, bool behind_gears, const FitRecord* fit,
                  std::vector<std::string>* notes = nullptr);

}  // namespace heft::model
