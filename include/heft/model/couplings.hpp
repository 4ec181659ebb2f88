/// @file
/// Gear couplings between joints that an arm has.
#pragma once

#include <vector>

#include "heft/core/friction/gear_coupling.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// @throws ModelError naming a coupling that is not one of two different joints of the robot
void refuse_wrong_couplings(const Robot& robot, const std::vector<GearCoupling<double>>& couplings);

}  // namespace heft::model
