/// @file
/// What no diagnosis can be made of.
#pragma once

#include <vector>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"

namespace heft::diagnose {

/// Nothing can be said about an arm that is at rest, or that moves for a moment.
/// @throws NotIdentifiableError
void refuse_too_little_motion(const model::Robot& robot, const std::vector<data::Log>& train);

/// Effects are looked for in what rigid bodies and friction leave; where a short log does not determine an eighth of
/// their parameters there is nothing to look in. Long logs are not asked.
/// @param bare  the robot with nothing but rigid bodies, Coulomb and viscous friction
/// @throws NotIdentifiableError
void refuse_too_few_parameters(const model::Robot& bare, const std::vector<data::Log>& train);

/// An effect is judged where the arm moves.
/// @throws NotIdentifiableError
void refuse_nothing_to_judge(const std::vector<data::Log>& validate);

}  // namespace heft::diagnose
