// The load of an arm while it moves. In the place of the robot is its own model with 2 kg, which is put down after five seconds.
// Prints:
//   after 5 s: known, 2.00 kg
//   after 10 s: none, changed at 5.0 s
#include <cmath>
#include <cstdio>

#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/model/named_arms.hpp"

using Observer = heft::LoadObserver<heft::model::Ur5Arm, double>;  // the arm without load
using Robot = heft::ArmTorque<heft::model::Ur5Arm, double>;

int run(Observer& observer, Robot& robot, double from, double to) {
  Observer::Vector q, qd, qdd, tau;
  Observer::Record record;
  for (double t = from; t < to; t += 0.001) {
    for (int i = 0; i < 6; ++i) {
      const double w = 1.1 + 0.4 * i;
      q[i] = 0.6 * std::sin(w * t), qd[i] = 0.6 * w * std::cos(w * t),
      qdd[i] = -0.6 * w * w * std::sin(w * t);
    }
    if (robot.update(0.001, q, qd, qdd, tau) != heft::Status::kOk) return 1;
    if (observer.update(q, qd, tau, 0.001, record) != heft::Status::kOk) return 1;
  }
  return 0;
}

int main() {
  Observer observer;
  Robot robot;
  if (observer.configure() != heft::Status::kOk || robot.configure() != heft::Status::kOk) return 1;
  if (robot.set_payload(2.0, {0, 0, 0.05}, {}) != heft::Status::kOk || run(observer, robot, 0, 5) != 0)
    return 1;
  std::printf("after 5 s: %s, %.2f kg\n", heft::to_string(observer.state()), observer.load()[heft::kMass]);
  if (robot.set_payload({}) != heft::Status::kOk || run(observer, robot, 5, 10) != 0) return 1;
  std::printf("after 10 s: %s, changed at %.1f s\n", heft::to_string(observer.state()),
              observer.last_change().time);
}
