#include "heft/model/at_sensor.hpp"

namespace heft::model {

Robot at_sensor(Robot robot) {
  for (RobotJoint& joint : robot.joints) joint.actuation = {};
  robot.couplings.clear();
  robot.effects.clear();
  for (Elasticity<double>& elasticity : robot.elasticities) elasticity.motor_inertia = 0.0;
  robot.torque_delay = 0.0;
  return robot;
}

}  // namespace heft::model
