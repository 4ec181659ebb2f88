/// @file
#pragma once

#include "heft/model/robot.hpp"

namespace heft::model {

/// The robot as a sensor behind the gears sees it: without rotor inertia, friction, couplings, joint effects and
/// the delay of the drives' channel; an elastic joint keeps its spring and loses the motor's inertia.
Robot at_sensor(Robot robot);

}  // namespace heft::model
