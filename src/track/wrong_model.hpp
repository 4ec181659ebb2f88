/// @file
/// A model that is wrong by a stated amount.
#pragma once

#include "heft/model/robot.hpp"
#include "heft/track/track.hpp"

namespace heft::track {

/// The robot with another mass, centre of mass and friction: every link's mass and each coordinate of its centre, every joint's
/// Coulomb, viscous and offset friction are multiplied by 1 ± a share drawn uniformly, all independently. Inertia
/// about the centre of mass grows with the mass. The same seed gives the same model.
model::Robot wrong_model(model::Robot robot, const WrongModel& error);

}  // namespace heft::track
