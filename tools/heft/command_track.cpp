/// @file
/// heft track: one scenario under several controllers, side by side.
#include <memory>
#include <string>

#include "command.hpp"
#include "console.hpp"
#include "example_scenario.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/tracking.hpp"
#include "heft/track/track.hpp"
#include "options.hpp"
#include "scenario_input.hpp"

namespace heft::tools {
namespace {

struct Options {
  std::string scenario;
  std::string model;
  double from{0.0};
  ResultOptions result;
};

void run(const Options& options) {
  const Console console{options.result.json};
  const sim::Scenario scenario = read_scenario(options.scenario);
  track::Options how;
  how.from = options.from;
  if (!options.model.empty()) how.model = model::read_model(options.model);
  const track::Tracking tracking = [&] {
    Progress progress("simulating");
    how.progress = [&](double done) { progress.update(done); };
    return track::track(scenario, how);
  }();
  for (const std::string& text : tracking.notes) note(text);
  console.print("{}", report::full(tracking));
  finish(console, "", options.result, report::json(tracking), report::page(tracking));
}

}  // namespace

Action set_up_track(CommandLine line) {
  auto options = std::make_shared<Options>();
  line.add_option("--scenario", options->scenario,
                  "robot, motion, sensors, events (JSON), as heft simulate takes it")
      .type_name("SCENARIO.json")
      .names_file(FileUse::kInput)
      .required();
  line.add_option(
          "--model", options->model,
          "model file with what the controllers believe, effects included; without it the scenario's robot and "
          "friction, without load and effects")
      .type_name("MODEL.json")
      .names_file(FileUse::kInput);
  line.add_option("--from", options->from, "errors count from this time on [s]")
      .not_negative()
      .capture_default_str();
  add_result_options(line, options->result);
  line.footer(
      std::string(kScenarioKeys) +
      "Compares PD, PD with gravity, computed torque with nominal values, computed torque with the load that is estimated\n"
      "while the arm moves, and adaptive control of the load (Slotine and Li, 1987), all with the same bandwidth.\n"
      "The scenario's controller may be of kind \"track\": bandwidth_hz (3), damping_ratio (1), "
      "friction_feed_forward (true),\n"
      "rows (1: torques of joints k..n go to the estimator), filter_hz (20), mass_prior [kg] (a third of the arm's mass),\n"
      "torque_residual (per joint, from friction and weight).\n"
      "Effects of the scenario are the arm's alone. With a --model that holds them computed torque feeds them forward along\n"
      "the reference. The error of an elastic joint is that of its link.\n"
      "Example: heft track --scenario pick.json --report pick.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
