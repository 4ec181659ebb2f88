/// @file
/// The key "effects" of a scenario: torques at joints, tool and base in addition to the declared friction.
#pragma once

#include "heft/host/settings_reader.hpp"
#include "heft/model/robot.hpp"
#include "heft/sim/simulator.hpp"

namespace heft::sim {

/// Reads a body's mass, com and inertia.
Body read_body(const host::SettingsReader& reader);

/// Reads "effects" into the settings: into the robot, the loads, gravity, the tool's wrench and the payload
/// events.
/// @param acting    the robot with the friction that is simulated, which some effects scale
/// @param settings  with n loads, gravity and payload events as far as other keys give them
/// @throws ModelError naming file and JSON path.
void read_effects(const host::SettingsReader& top, const model::Robot& acting, SimulationSettings& settings);

}  // namespace heft::sim
