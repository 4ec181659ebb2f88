/// @file
/// heft simulate: runs a scenario file on the simulated arm and writes its log.
#include <memory>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "example_scenario.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/excite/motion.hpp"
#include "heft/host/file.hpp"
#include "heft/page/page.hpp"
#include "host/json.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "scenario_input.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  std::string scenario, replay;
  std::string output;
  ResultOptions result;
  bool example{false};
};

const char* name_of(sim::SimulationEvent::Kind kind) {
  switch (kind) {
    case sim::SimulationEvent::Kind::kGrasp: return "grasp";
    case sim::SimulationEvent::Kind::kRelease: return "release";
    case sim::SimulationEvent::Kind::kStick: return "stick";
    case sim::SimulationEvent::Kind::kSlip: return "slip";
  }
  return "event";
}

/// Root mean square of reference minus position, per joint; empty without a reference.
Eigen::VectorXd tracking_error(const data::Log& log) {
  if (log.qref.cols() != log.q.cols()) return {};
  return (log.qref - log.q).colwise().squaredNorm().cwiseSqrt() /
         std::sqrt(static_cast<double>(log.num_samples()));
}

/// A plot a joint of one channel, with its reference where there is one and the payload events as marks.
std::vector<page::PlotSpec> channel_plots(const sim::SimulationResult& result, const Eigen::MatrixXd& channel,
                                          const Eigen::MatrixXd& reference, const std::string& label) {
  std::vector<page::PlotSpec> plots;
  const data::Log& log = result.log;
  for (Eigen::Index j = 0; j < channel.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = label;
    const bool has_reference = reference.cols() == channel.cols();
    if (has_reference)
      spec.series.push_back(page::line("reference", log.time, reference.col(j), page::Hue::kNeutral));
    spec.series.push_back(
        page::line(has_reference ? "measured" : "", log.time, channel.col(j), page::Hue::kBlue));
    for (const sim::SimulationEvent& event : result.events) {
      if (event.joint < 0)
        spec.marks.push_back({page::Mark::Direction::kVertical, event.time, name_of(event.kind)});
    }
    plots.push_back(std::move(spec));
  }
  return plots;
}

/// A simulation and what it was of.
struct Run {
  std::string robot, source;
  sim::SimulationResult result;
};

Run replay(const Options& options) {
  const model::Robot robot = load_robot(options.robot);
  data::LogFiles files;
  files.judge = {options.replay};
  files.robot = robot.name;
  files.torque = false;
  std::vector<std::string> notes;
  const data::Log motion = data::read_motion(open_logs(robot, files).judge().front(), true, &notes).log;
  for (const std::string& text : notes) note(text);
  const double begin = motion.time[0], duration = motion.time[motion.num_samples() - 1] - begin;
  const auto reference = sim::make_sampled(motion.time.array() - begin, motion.q, motion.qd, motion.qdd);
  return {robot.name, options.replay, sim::simulate(excite::replay_settings(robot, reference, duration))};
}

Run run_of(const Options& options) {
  if (!options.replay.empty()) return replay(options);
  const sim::Scenario scenario = read_scenario(options.scenario);
  return {scenario.settings.robot.name, options.scenario, sim::simulate_scenario(scenario)};
}

void run(const Options& options) {
  const Console console{options.output, options.result.json};
  const auto [robot_name, source, result] = run_of(options);
  const data::Log& log = result.log;
  const double duration = log.time[log.num_samples() - 1] - log.time[0];

  nlohmann::ordered_json json{{options.replay.empty() ? "scenario" : "replay", source},
                              {"robot", robot_name},
                              {"samples", log.num_samples()},
                              {"duration", duration}};
  json["events"] = nlohmann::ordered_json::array();
  std::size_t num_payload = 0, num_stick = 0;
  std::string happened;
  for (const sim::SimulationEvent& event : result.events) {
    json["events"].push_back({{"time", event.time},
                              {"kind", name_of(event.kind)},
                              {"joint", event.joint < 0 ? nlohmann::ordered_json(nullptr)
                                                        : nlohmann::ordered_json(event.joint + 1)}});
    if (event.joint < 0) {
      ++num_payload;
      happened += fmt::format("  {} at {:.4f} s\n", name_of(event.kind), event.time);
    } else if (event.kind == sim::SimulationEvent::Kind::kStick) {
      ++num_stick;
    }
  }
  json["solver"] = {{"steps", result.counts.steps},
                    {"evaluations", result.counts.evaluations},
                    {"failed_steps", result.counts.failed_steps},
                    {"restarts", result.counts.restarts}};
  std::string text = fmt::format(
      "{} simulated for {:.6g} s: {} samples, {} payload events, {} times a joint came to stick\n{}",
      robot_name, duration, log.num_samples(), num_payload, num_stick, happened);
  const Eigen::VectorXd error = tracking_error(log);
  page::Table table({"joint", "RMS tracking error [rad, m]", "largest torque [N·m, N]"});
  if (error.size() > 0) json["rms_tracking_error"] = host::json_array(error);
  for (int j = 0; j < log.num_joints(); ++j) {
    table.add_row({fmt::format("{}", j + 1), error.size() > 0 ? page::number(error[j]) : "–",
                   log.tau.cols() > 0 ? page::number(log.tau.col(j).cwiseAbs().maxCoeff()) : "–"});
  }
  text += table.to_text(2);

  page::Page page = new_page(fmt::format("{}: simulation", robot_name), file_name_of(source));
  page.verdict(fmt::format("{:.6g} s simulated, {} payload events.", duration, num_payload));
  page.table(table);
  page.plots("Position", channel_plots(result, log.q, log.qref, "position [rad, m]"));
  page.plots("Torque", channel_plots(result, log.tau, {}, "torque [N·m, N]"));
  console.print("{}", text);
  finish(console, options.output, options.result, json, page, [&] { data::write_log(options.output, log); });
}

}  // namespace

Action set_up_simulate(CommandLine line) {
  auto options = std::make_shared<Options>();
  line.add_option("--scenario", options->scenario,
                  "what to simulate: robot, motion, controller, sensors, events (JSON)")
      .type_name("SCENARIO.json")
      .names_file(FileUse::kInput);
  line.add_option("--replay", options->replay,
                  "a motion (CSV: time, q*, better with qd*, qdd*) that the arm of --urdf follows under "
                  "computed torque")
      .type_name("MOTION.csv")
      .names_file(FileUse::kMeasurements);
  add_robot_options(line, options->robot);
  add_output_option(line, options->output, "the log (CSV); - is standard output", false);
  add_result_options(line, options->result);
  line.add_flag("--example", options->example, "print a complete scenario with comments, and nothing else");
  line.parse_complete_callback([options] {
    if (options->example) return;
    if (options->scenario.empty() && options->replay.empty()) {
      throw UsageError(
          "--scenario is required: what to simulate; heft simulate --example prints one to begin with; or "
          "give a motion "
          "with --urdf ROBOT --replay MOTION.csv");
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
