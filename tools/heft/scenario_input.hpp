/// @file
/// Scenario files as the commands read them.
#pragma once

#include <string>

#include "heft/sim/scenario.hpp"

namespace heft::tools {

/// Reads a scenario whose robot is a URDF next to the scenario file, a URDF path, or a robot's name.
sim::Scenario read_scenario(const std::string& path);

}  // namespace heft::tools
