/// @file
/// A robot without what was found beyond rigid bodies and declared friction.
#pragma once

#include "heft/model/robot.hpp"

namespace heft::model {

/// The robot with rigid bodies, rotor inertia and declared friction alone: without gear couplings, cables, joint
/// effects, elastic joints and delay of the torque channel.
Robot without_effects(Robot robot);

}  // namespace heft::model
