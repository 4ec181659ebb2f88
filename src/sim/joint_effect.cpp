#include "heft/sim/joint_effect.hpp"

namespace heft::sim {

double JointEffect::breakaway(const JointPoint& at_rest, int direction, const double* state) const {
  JointPoint rest = at_rest;
  rest.direction = 0.0;
  JointPoint slipping = at_rest;
  slipping.direction = direction;
  return direction * (torque(slipping, state) - torque(rest, state));
}

}  // namespace heft::sim
