/// @file
/// Scenario files: a simulation described in JSON. Format: src/sim/README.md
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "heft/data/log.hpp"
#include "heft/host/settings_reader.hpp"
#include "heft/model/robot.hpp"
#include "heft/sim/controller.hpp"
#include "heft/sim/simulator.hpp"

namespace heft::sim {

/// Turns the scenario's robot name or path into a robot. What it throws goes to the caller.
using RobotLoader = std::function<model::Robot(const std::string& name)>;

/// The scenario's controller, still to be made.
struct ControllerRequest {
  std::string kind;               ///< "none", "pd", "pd_gravity" or one that a factory knows
  host::SettingsReader settings;  ///< the controller's object; "kind" is already known
};

/// A simulation as a file describes it.
struct Scenario {
  std::string file;             ///< for messages
  std::string robot_name;       ///< as the file names it
  SimulationSettings settings;  ///< complete but for the controller
  ControllerRequest controller;
};

/// Makes controllers of kinds that this room does not know. Reads its keys from the request's settings and
/// calls finish() on them; returns null for a kind it does not know either.
using ControllerFactory = std::function<std::shared_ptr<Controller>(const ControllerRequest& request,
                                                                    const SimulationSettings& settings)>;

/// Reads a scenario.
/// @param json  text of the file
/// @param file  its name, for messages
/// @throws ModelError naming file and JSON path, what was found, what was expected and what to do.
Scenario parse_scenario(std::string_view json, const std::string& file, const RobotLoader& load_robot);

/// Makes the scenario's controller; null for kind "none".
/// @throws ModelError when neither this room nor the factory knows the kind.
std::shared_ptr<Controller> make_controller(const Scenario& scenario, const ControllerFactory& factory = {});

/// Runs a scenario and gives its log. May be called again: every run makes its own controller.
data::Log run_scenario(const Scenario& scenario, const ControllerFactory& factory = {});

/// The same with events and solver counts.
SimulationResult simulate_scenario(const Scenario& scenario, const ControllerFactory& factory = {});

}  // namespace heft::sim
