#include "heft/model/without_effects.hpp"

namespace heft::model {

Robot without_effects(Robot robot) {
  robot.couplings.clear();
  robot.cables.clear();
  robot.effects.clear();
  robot.elasticities.clear();
  robot.torque_delay = 0.0;
  return robot;
}

}  // namespace heft::model
