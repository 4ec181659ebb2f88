#include "heft/model/at_sensor.hpp"

namespace heft::model {

Robot at_sensor(Robot robot) {
  for (RobotJoint& joint : robot.joints) joint.actuation = {};
  robot.couplings.clear();
  robot.cables.clear();
  robot.effects.clear();
  for (Elasticity<double>& elasticity : robot.elasticities) elasticity.motor_inertia = 0.0;
  robot.torque_delay = 0.0;
  return robot;
}

Robot as_measured(const Robot& robot, bool behind_gears, const FitRecord* fit,
                  std::vector<std::string>* notes) {
  const bool fitted_behind_gears = fit != nullptr && fit->torque_at == "joint";
  if (behind_gears && !fitted_behind_gears) return at_sensor(robot);
  if (!behind_gears && fitted_behind_gears && notes != nullptr) {
    notes->push_back(
        "the model was fitted to torque behind the gears: rotor inertia and gear friction are not in it");
  }
  return robot;
}

}  // namespace heft::model
