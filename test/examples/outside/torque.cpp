#include <cstdio>

#include "heft/core/dynamics/inverse_dynamics.hpp"

int main() {
  heft::ArmModel<double, 1> model;
  model.joints[0].axis = {0, 1, 0};
  model.links[0][heft::kMass] = 2.0;
  model.links[0][heft::kMcx] = 1.0;
  const heft::DynamicArm<double, 1> arm(model);
  using V = heft::JointVector<double, 1>;
  std::printf("%.3f\n", heft::inverse_dynamics(arm, V(0.0), V(0.0), V(0.0))[0]);
}
