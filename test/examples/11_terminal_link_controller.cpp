// Computed torque that learns the wrist and its load on the way, from encoders and torques. In the place of the robot is the
// model of the arm with a load, which follows its reference exactly.
// Prints:
//   prior: joint 5 -0.252 N·m
//   instrumental variables: joint 5 -0.245 N·m, the loaded arm -0.245 N·m
#include <cmath>
#include <cstdio>

#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/model/named_arms.hpp"

using Controller = heft::TerminalLinkController<heft::model::KawasakiArm, double, 4>;  // joints 5 and 6 feel
using Robot = heft::ArmTorque<heft::model::KawasakiArmWithPayload, double>;

Controller::Reference motion(double t) {
  Controller::Reference r;
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      const double w = 1.7 + 1.45 * k + 0.19 * i, a = (i < 3 ? 2.0 : 6.0) / (w * w),
                   angle = w * t + 1.7 * k + 0.9 * i * k + i;
      r.q[i] += a * std::sin(angle), r.qd[i] += a * w * std::cos(angle),
          r.qdd[i] -= a * w * w * std::sin(angle);
    }
  }
  return r;
}

int main() {
  Controller controller;
  Robot robot;
  Controller::Vector measured = Controller::Vector::Zero(), tau = measured;
  Controller::Record record;
  if (controller.configure({}) != heft::Status::kOk || robot.configure() != heft::Status::kOk) return 1;
  for (int k = 0; k <= 20000; ++k) {
    const Controller::Reference now = motion(0.001 * k), between = motion(0.001 * (k + 0.5));
    if (controller.update(now, now.q, measured, 0.001, tau, record) != heft::Status::kOk) return 1;
    if (k == 2) std::printf("%s: joint 5 %.3f N·m\n", heft::to_string(record.source), tau[4]);
    if (robot.update(0.001, between.q, between.qd, between.qdd, measured) != heft::Status::kOk) return 1;
  }
  std::printf("%s: joint 5 %.3f N·m, the loaded arm %.3f N·m\n", heft::to_string(record.source), tau[4],
              measured[4]);
}
