// Friction while the arm moves. In the place of the robot is its own model, warm: friction is 30 % lower than in the model that
// the estimator is given.
// Prints:
//   At 9.92 s the samples determine 22 of 22 parameters; 4 % of the window's rows are outliers.
//   joint 1: Coulomb friction 3.50 N·m, cold 5.00
//   joint 2: Coulomb friction 3.50 N·m, cold 5.00
//   joint 3: Coulomb friction 2.80 N·m, cold 4.00
#include <cmath>
#include <cstdio>

#include "heft/identify/moving_horizon.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/named_arms.hpp"
#include "heft/model/robot_of.hpp"
#include "heft/report/moving_horizon.hpp"

int main() {
  const heft::model::Robot cold = heft::model::robot_of(heft::model::Ur5Arm::kModel, "ur5");
  heft::model::Robot warm = cold;
  for (auto& joint : warm.joints) joint.actuation.coulomb_friction *= 0.7;
  const heft::model::Dynamics arm(warm);
  heft::identify::MovingHorizon horizon(cold);  // unknown: the last link and the friction of every joint
  const Eigen::ArrayXd w = Eigen::ArrayXd::LinSpaced(6, 1.1, 3.1);
  for (double t = 0.0; t < 10.0; t += 0.002) {
    const Eigen::VectorXd q = 0.6 * (w * t).sin(), qd = 0.6 * w * (w * t).cos(),
                          qdd = -w.square() * q.array();
    horizon.push({t, q, qd, arm.joint_torque(q, qd, qdd)});
  }
  std::printf("%s\n", heft::report::brief(horizon.estimate()).c_str());
  const heft::model::Robot now = horizon.estimate().robot();
  for (std::size_t i = 0; i < 3; ++i)
    std::printf("joint %zu: Coulomb friction %.2f N·m, cold %.2f\n", i + 1,
                now.joints[i].actuation.coulomb_friction, cold.joints[i].actuation.coulomb_friction);
  return horizon.estimate().usable() ? 0 : 4;
}
