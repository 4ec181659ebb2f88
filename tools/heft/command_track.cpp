/// @file
/// heft track: one scenario under several controllers, side by side.
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

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

struct TrackOptions {
  std::string scenario;
  std::string model;
  double from{0.0};
  std::vector<double> wrong_model;
  std::uint64_t seed{1};
  std::vector<double> loads;
  ResultOptions result;
};

/// Prints an answer and what should be known besides, and writes its files.
template <typename Answer>
void show(const Answer& answer, const std::vector<std::string>& notes, const Console& console,
          const ResultOptions& result) {
  for (const std::string& text : notes) note(text);
  console.print("{}", report::full(answer));
  finish(console, "", result, report::json(answer), report::page(answer));
}

void run(const TrackOptions& options) {
  const Console console{options.result.json};
  const sim::Scenario scenario = read_scenario(options.scenario);
  track::Options how;
  how.from = options.from;
  if (!options.model.empty()) how.model = model::read_model(options.model);
  if (!options.wrong_model.empty()) {
    how.wrong = track::WrongModel{options.wrong_model[0], options.wrong_model[1], options.seed};
  }
  auto progress = std::make_unique<Progress>("simulating");
  how.progress = [&](double done) { progress->update(done); };
  if (options.loads.empty()) {
    const track::Tracking tracking = track::track(scenario, how);
    progress.reset();
    show(tracking, tracking.notes, console, options.result);
  } else {
    const track::LoadComparison comparison = track::compare_loads(scenario, options.loads, how);
    progress.reset();
    show(comparison, comparison.tracking.front().notes, console, options.result);
  }
}

}  // namespace

Action set_up_track(CommandLine line) {
  auto options = std::make_shared<TrackOptions>();
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
  const auto wrong =
      line.add_option(
              "--wrong-model", options->wrong_model,
              "make masses, centres of mass and friction of the controllers' arm wrong by shares between these; adds "
              "computed torque with the arm as it was, and with links, friction and load estimated on the way")
          .type_name("LEAST,MOST")
          .delimiter(',')
          .expected(2)
          .not_negative();
  line.add_option("--seed", options->seed, "seed of the shares that --wrong-model draws")
      .needs(wrong)
      .capture_default_str();
  line.add_option(
          "--loads", options->loads,
          "compare these masses [kg] in the place of that of the scenario's load, with a table for each")
      .type_name("KG,KG,...")
      .delimiter(',')
      .not_negative();
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    const std::vector<double>& shares = options->wrong_model;
    if (!shares.empty() && !(shares[0] <= shares[1] && shares[1] < 1.0)) {
      throw UsageError(fmt::format(
          "--wrong-model: found {:g},{:g}; expected shares LEAST,MOST below 1, the smaller one first, "
          "0.1,0.3 for 10 to 30 %",
          shares[0], shares[1]));
    }
  });
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
      "Examples:\n"
      "  heft track --scenario pick.json --report pick.html\n"
      "  heft track --scenario pick.json --from 3 --wrong-model 0.1,0.3 --loads 0,2,5");
  return [options] { run(*options); };
}

}  // namespace heft::tools
