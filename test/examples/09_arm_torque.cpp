// The whole torque of a model in one call, as firmware feeds it forward along a motion. `heft export` writes the header of your
// robot; here it is a UR5 that is held out straight, empty and with 3 kg at its flange.
// Prints:
//   empty: joint 2 -53.8 N·m, joint 3 -15.6 N·m
//   3 kg: joint 2 -77.9 N·m, joint 3 -27.2 N·m
#include <cstdio>

#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/model/named_arms.hpp"

int main() {
  heft::ArmTorque<heft::model::Ur5Arm, float> arm;
  if (arm.configure() != heft::Status::kOk) return 1;
  const heft::JointVector<float, 6> q = heft::JointVector<float, 6>::Zero(), qd = q, qdd = q;
  heft::JointVector<float, 6> tau;
  if (arm.update(0.001F, q, qd, qdd, tau) != heft::Status::kOk) return 1;
  std::printf("empty: joint 2 %.1f N·m, joint 3 %.1f N·m\n", tau[1], tau[2]);
  // Mass, centre of mass in the flange frame, inertia about it: a body that cannot exist is refused.
  if (arm.set_payload(3.0F, {0, 0, 0.05F}, {0.01F, 0, 0.01F, 0, 0, 0.01F}) != heft::Status::kOk) return 1;
  if (arm.update(0.001F, q, qd, qdd, tau) != heft::Status::kOk) return 1;
  std::printf("3 kg: joint 2 %.1f N·m, joint 3 %.1f N·m\n", tau[1], tau[2]);
}
