/// @file
/// heft simulate: runs a scenario file on the simulated arm and writes its log.
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "example_scenario.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/excite/motion.hpp"
#include "heft/host/file.hpp"
#include "heft/report/simulation.hpp"
#include "heft/sim/simulation.hpp"
#include "options.hpp"
#include "scenario_input.hpp"

namespace heft::tools {
namespace {

struct SimulateOptions {
  RobotOptions robot;
  std::string scenario, replay;
  std::string output;
  ReadOptions read;
  ResultOptions result;
  bool example{false};
};

sim::Simulation replay(const SimulateOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  data::LogFiles files;
  files.judge = {options.replay};
  files.robot = robot.name;
  files.torque = false;
  files.as = read_as(options.read, robot);
  std::vector<std::string> notes;
  const data::Log motion = data::read_motion(open_logs(robot, files).judge().front(), true, &notes).log;
  for (const std::string& text : notes) note(text);
  return {robot.name, options.replay, true, excite::replay(robot, motion)};
}

sim::Simulation simulation_of(const SimulateOptions& options) {
  if (!options.replay.empty()) return replay(options);
  const sim::Scenario scenario = read_scenario(options.scenario);
  return {scenario.settings.robot.name, options.scenario, false, sim::simulate_scenario(scenario)};
}

void run(const SimulateOptions& options) {
  const Console console{options.output, options.result.json};
  const sim::Simulation simulation = simulation_of(options);
  console.print("{}", report::full(simulation));
  finish(console, options.output, options.result, report::json(simulation), report::page(simulation),
         [&] { data::write_log(options.output, simulation.result.log); });
}

}  // namespace

Action set_up_simulate(CommandLine line) {
  auto options = std::make_shared<SimulateOptions>();
  line.add_option("--scenario", options->scenario,
                  "what to simulate: robot, motion, controller, sensors, events (JSON)")
      .type_name("SCENARIO.json")
      .names_file(FileUse::kInput);
  line.add_option("--replay", options->replay,
                  "a motion (CSV: time, q*, better with qd*, qdd*) that the arm of --urdf follows under "
                  "computed torque")
      .type_name("MOTION.csv")
      .names_file(FileUse::kMeasurements);
  add_read_options(line, options->read);
  add_robot_options(line, options->robot);
  add_output_option(line, options->output, "the log (CSV); - is standard output", false);
  add_result_options(line, options->result);
  line.add_flag("--example", options->example, "print a complete scenario with comments, and nothing else");
  line.parse_complete_callback([options] {
    if (options->example) return;
    if (options->scenario.empty() && options->replay.empty()) {
      throw UsageError(
          "--scenario is required: what to simulate; heft simulate --example prints one to begin with; "
          "or give a motion with --urdf ROBOT --replay MOTION.csv");
    }
    if (options->output.empty()) throw UsageError("--output is required: where the log goes");
    if (options->scenario.empty() == options->replay.empty()) {
      throw UsageError(
          "give what to simulate: either --scenario SCENARIO.json or --urdf ROBOT --replay MOTION.csv");
    }
    if (!options->scenario.empty() && (!options->robot.urdf.empty() || !options->robot.model.empty())) {
      throw UsageError("--urdf and --model belong to --replay; a scenario names its own robot");
    }
  });
  line.footer(std::string(kScenarioKeys) +
              "The scenario names its robot as --urdf does elsewhere; a relative path is looked up in the "
              "folder of the scenario first.\n"
              "Example: heft simulate --scenario pick.json -o pick.csv\n"
              "Example: heft simulate --urdf ur10e --replay exciting.csv -o log.csv");
  return [options] {
    if (options->example) return host::write_file_atomically("-", kExampleScenario);
    run(*options);
  };
}

}  // namespace heft::tools
