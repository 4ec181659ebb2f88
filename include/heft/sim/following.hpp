/// @file
/// An arm that follows a reference as well as its own model allows: what a motion is rehearsed with.
#pragma once

#include <memory>

#include "heft/model/robot.hpp"
#include "heft/sim/reference.hpp"
#include "heft/sim/simulator.hpp"

namespace heft::sim {

/// A simulated arm under computed torque with the arm's own model, closed loop at 50 rad/s, friction fed forward as the reference
/// moves; 500 samples and 100 log rows a second, encoders of 2e-5 rad (m), exact velocities, integrated to 1e-8 rad and
/// rad/s (m, m/s). It begins on the reference.
/// The controller computes with core's dynamics, the arm with the simulator's.
SimulationSettings following(const model::Robot& robot, std::shared_ptr<const Reference> reference,
                             double duration);

}  // namespace heft::sim
