// An arm that tracks a motion in the simulator.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/sim/simulator.hpp"
#include "support/arms.hpp"

namespace heft::test {

/// Six joints tracking a motion with position-velocity feedback and gravity torque at 1 kHz, with friction.
inline sim::SimulationSettings tracking_arm(const sim::FourierMotion& motion, double duration) {
  sim::SimulationSettings s;
  s.robot = six_joint_arm();
  s.duration = duration;
  s.initial_position = motion.q0;
  s.reference = sim::ramp_in(sim::make_fourier(motion), motion.q0, 1.0);
  s.loads = sim::friction_of(s.robot);
  s.torque_limit = sim::effort_limits_of(s.robot);
  Eigen::VectorXd kp(6), kd(6);
  kp << 3000, 3000, 2000, 300, 300, 300;
  kd << 150, 150, 100, 15, 15, 15;
  s.controller = std::make_shared<sim::PdController>(kp, kd, std::make_shared<sim::ForwardDynamics>(s.robot));
  return s;
}

}  // namespace heft::test
