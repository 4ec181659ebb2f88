// PD holds the arm until the load is known, then computed torque with the load takes over. In the place of the robot is its own model
// with 2 kg, which follows exactly. Prints:
//   jump of the torque at the switch: 0.000 N·m
//   load: 2.00 kg
#include <cmath>
#include <cstdio>

#include "heft/core/control/arm_controllers.hpp"
#include "heft/core/control/controller_switch.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/model/named_arms.hpp"

using Ur5 = heft::model::Ur5Arm;  // or a header of `heft export`
using Pd = heft::PdController<Ur5, double>;
using Estimating = heft::LoadEstimatingController<Ur5, double>;

int main() {
  heft::ControllerSwitch<Pd, Estimating> control;
  heft::ArmTorque<Ur5, double> robot;
  if (control.get<0>().configure() != heft::Status::kOk ||
      control.get<1>().configure() != heft::Status::kOk || robot.configure() != heft::Status::kOk ||
      robot.set_payload(2.0, {0, 0, 0.05}, {}) != heft::Status::kOk)
    return 1;
  Pd::Reference reference;
  Pd::Measurement measured;
  measured.dt = 0.001;
  Pd::Vector before = Pd::Vector::Zero();
  for (int k = 0; k <= 5000; ++k) {
    for (int i = 0; i < 6; ++i) {
      const double w = 1.1 + 0.4 * i;
      reference.q[i] = 0.6 * std::sin(w * 0.001 * k), reference.qd[i] = 0.6 * w * std::cos(w * 0.001 * k);
      reference.qdd[i] = -w * w * reference.q[i];
    }
    if (robot.update(0.001, reference.q, reference.qd, reference.qdd, measured.tau) != heft::Status::kOk)
      return 1;
    measured.q = reference.q, measured.qd = reference.qd;
    if (k == 5000 && control.select(1) != heft::Status::kOk) return 1;
    const auto step = control.step(reference, measured);
    if (step.status != heft::Status::kOk) return 1;
    if (k == 5000) std::printf("jump of the torque at the switch: %.3f N·m\n", (step.torque - before).norm());
    before = step.torque;
  }
  std::printf("load: %.2f kg\n", control.get<1>().load()[heft::kMass]);
}
