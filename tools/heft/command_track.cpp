/// @file
/// heft track: one scenario under several controllers, side by side.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "example_scenario.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/settings_reader.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/model_file.hpp"
#include "heft/page/page.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/validate/judgement.hpp"
#include "host/json.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "payload_result.hpp"
#include "scenario_input.hpp"
#include "sim_controllers.hpp"

namespace heft::tools {
namespace {

struct Options {
  std::string scenario;
  std::string model;
  double from{0.0};
  ResultOptions result;
};

constexpr std::array<TrackingMethod, 4> kMethods = {TrackingMethod::kPd, TrackingMethod::kPdGravity,
                                                    TrackingMethod::kComputedTorque,
                                                    TrackingMethod::kEstimated};

/// Friction values that the scenario states for the arm belong to what the controllers know; the load does not.
void take_friction(const std::string& path, model::Robot& robot) {
  const host::SettingsReader top = host::SettingsReader::parse(host::read_file(path, "scenario"), path);
  if (!top.has("friction") || top.is_text("friction")) return;
  const host::SettingsReader friction = top.object("friction");
  const int n = robot.num_joints();
  const Eigen::VectorXd coulomb = friction.numbers_or_none("coulomb", n),
                        viscous = friction.numbers_or_none("viscous", n),
                        offset = friction.numbers_or_none("offset", n);
  for (int i = 0; i < n; ++i) {
    JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(i)].actuation;
    if (coulomb.size() > 0) actuation.coulomb_friction = coulomb[i];
    if (viscous.size() > 0) actuation.viscous_friction = viscous[i];
    if (offset.size() > 0) actuation.friction_offset = offset[i];
  }
}

/// What acts undeclared in the scenario is what controllers do not know, unless a model tells them.
void forget_effects(model::Robot& robot) {
  robot.couplings.clear();
  robot.effects.clear();
  robot.elasticities.clear();
  robot.torque_delay = 0.0;
}

/// Reference less position; for elastic joints that of the link, which the motor's encoder does not see.
Eigen::MatrixXd tracking_error(const data::Log& log, const model::Robot& robot) {
  Eigen::MatrixXd error = log.qref - log.q;
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    const std::string name = fmt::format("qlink{}", elasticity.joint + 1);
    for (const auto& [column, values] : log.extra) {
      if (column == name) error.col(elasticity.joint) = log.qref.col(elasticity.joint) - values;
    }
  }
  return error;
}

/// Settings from the scenario's controller of kind "track"; defaults with any other kind.
TrackingSettings read_settings(const sim::Scenario& scenario) {
  TrackingSettings settings;
  if (scenario.controller.kind == "track") {
    const host::SettingsReader& reader = scenario.controller.settings;
    settings.bandwidth_hz = reader.number_or("bandwidth_hz", settings.bandwidth_hz, host::Range::kPositive);
    settings.damping_ratio =
        reader.number_or("damping_ratio", settings.damping_ratio, host::Range::kPositive);
    settings.friction_feed_forward = reader.flag_or("friction_feed_forward", true);
    const int n = scenario.settings.robot.num_joints();
    if (reader.has("rows")) settings.rows = static_cast<int>(reader.whole_number("rows", 1, n));
    settings.filter_hz = reader.number_or("filter_hz", settings.filter_hz, host::Range::kPositive);
    settings.mass_prior = reader.number_or("mass_prior", 0.0, host::Range::kNotNegative);
    settings.noise = reader.numbers_or_none("torque_residual", n, host::Range::kPositive);
    reader.finish();
  } else if (scenario.controller.kind != "none") {
    note(
        fmt::format("{}: its own controller \"{}\" is not used here; a controller of kind \"track\" sets "
                    "what the compared ones share",
                    scenario.file, scenario.controller.kind));
  }
  return settings;
}

TrackingRun part_of(const TrackingRun& run, double from) {
  Eigen::Index first = 0;
  while (first < run.time.size() && run.time[first] < from) ++first;
  const Eigen::Index rows = run.time.size() - first;
  return {run.name, run.time.tail(rows), run.error.bottomRows(rows), run.torque.bottomRows(rows)};
}

double rms(const TrackingRun& run) {
  return std::sqrt(run.error.squaredNorm() /
                   static_cast<double>(std::max<Eigen::Index>(1, run.error.size())));
}

void run(const Options& options) {
  const Console console{options.result.json};
  const sim::Scenario scenario = read_scenario(options.scenario);
  const sim::SimulationSettings& base = scenario.settings;
  if (base.reference == nullptr) {
    throw ModelError(fmt::format(
        "{}: /reference: found none, expected a motion to be tracked; add \"reference\"", options.scenario));
  }
  if (options.from >= base.duration) {
    throw ModelError(
        fmt::format("{}: /duration: found {} s, expected more than the {} s of --from; lower --from",
                    options.scenario, base.duration, options.from));
  }
  model::Robot nominal = base.robot;
  forget_effects(nominal);
  take_friction(options.scenario, nominal);
  if (!options.model.empty()) {
    std::vector<std::string> notes;
    model::apply(model::read_model(options.model), nominal, &notes);
    for (const std::string& text : notes) note(text);
  }
  const Eigen::Vector3d believed = Eigen::Map<const Eigen::Vector3d>(nominal.gravity.data());
  if (base.gravity && !base.gravity->isApprox(believed, 1e-6)) {
    // The controllers believe the base to be as the scenario's robot has it; a tilt is for the plant alone.
    note(fmt::format("{}: gravity differs from the {}; the controllers are not told", options.scenario,
                     options.model.empty() ? "robot's" : "model's"));
  }
  TrackingSettings settings = read_settings(scenario);
  settings.torque_limit = base.torque_limit;
  settings.inertia = mean_inertia(nominal, *base.reference, base.duration);

  const auto trace = std::make_shared<LoadTrace>();
  std::vector<TrackingRun> runs(kMethods.size());
  std::vector<sim::SimulationEvent> events;
  {
    Progress progress("simulating");
    host::for_each_parallel(
        kMethods.size(),
        [&](std::size_t i) {
          sim::SimulationSettings own = base;
          own.controller = make_tracking_controller(
              kMethods[i], nominal, settings, kMethods[i] == TrackingMethod::kEstimated ? trace : nullptr);
          own.log_truth = own.log_truth || !base.robot.elasticities.empty();
          sim::SimulationResult result = sim::simulate(own);
          runs[i] = {to_string(kMethods[i]), result.log.time, tracking_error(result.log, base.robot),
                     result.log.tau};
          if (kMethods[i] == TrackingMethod::kEstimated) events = std::move(result.events);
        },
        [&](double done) { progress.update(done); });
  }

  std::vector<page::Mark> marks;
  double last_event = 0;
  double true_mass = 0;
  std::size_t next = 0;
  for (const sim::SimulationEvent& event : events) {
    if (event.joint >= 0) continue;
    const bool grasp = event.kind == sim::SimulationEvent::Kind::kGrasp;
    marks.push_back({page::Mark::Direction::kVertical, event.time, grasp ? "grasp" : "release"});
    last_event = event.time;
    true_mass = grasp ? base.payload_events[next].body.mass : 0.0;
    ++next;
  }

  std::vector<TrackingRun> counted;
  for (const TrackingRun& r : runs) counted.push_back(part_of(r, options.from));
  std::vector<TrackingRun> after;
  const double settled = last_event + 1.0;
  if (!marks.empty() && settled < base.duration && settled > options.from) {
    for (const TrackingRun& r : runs) after.push_back(part_of(r, settled));
  }

  const double mass = trace->mass.empty() ? std::nan("") : trace->mass.back();
  const double half = trace->mass.empty() ? std::nan("") : trace->mass_half_width.back();
  nlohmann::ordered_json json{
      {"scenario", options.scenario},
      {"robot", base.robot.name},
      {"bandwidth_hz", settings.bandwidth_hz},
      {"from", options.from},
      {"model_effects", nominal.effects.size() + nominal.elasticities.size() + nominal.couplings.size()},
      {"controllers", tracking_json(counted)}};
  if (!after.empty()) {
    json["after_last_payload_event"] = {{"from", settled}, {"controllers", tracking_json(after)}};
  }
  // The mass is held against the truth, the tracking against what it is without the estimate.
  const std::vector<TrackingRun>& judged = after.empty() ? counted : after;
  host::Judgement judgement;
  if (std::isfinite(half))
    judgement.add(validate::judge_against_truth("the estimated mass", mass, half, true_mass));
  judgement.add(validate::judge_improvement("the tracking error with the estimated load", rms(judged[3]),
                                            "that with nominal values", rms(judged[2])));
  put_verdict(json, judgement);
  json["load"] = {{"mass",
                   {{"value", host::number_or_null(mass)},
                    {"std", host::number_or_null(half / statistics::kNormal95)},
                    {"half_width_95", host::number_or_null(half)},
                    {"identifiable", std::isfinite(half)},
                    {"true", true_mass}}},
                  {"changes", trace->change},
                  {"rows", settings.rows}};

  std::string load_text = "The load was not told from the motion by the end of the run.";
  if (std::isfinite(half)) {
    load_text = fmt::format("Estimated load at the end: {:.4f} kg ± {:.4f} kg (95 %), in truth {:.4f} kg.",
                            mass, half, true_mass);
    if (mass + half < 0) {
      load_text +=
          " No load weighs less than nothing: the model of the arm itself does not hold, and the estimate is "
          "not used.";
    }
  }
  console.print(
      "{}, {:.6g} s at {:.6g} Hz, every controller with {:.3g} Hz bandwidth\nRMS tracking error{}:\n{}",
      base.robot.name, base.duration, base.sample_rate, settings.bandwidth_hz,
      options.from > 0 ? fmt::format(" from {:.6g} s on", options.from) : "",
      tracking_table(counted).to_text(2));
  if (!after.empty()) {
    console.print("From {:.6g} s on, 1 s after the last payload event:\n{}", settled,
                  tracking_table(after).to_text(2));
  }
  console.print("{}\n{}", load_text, verdict_text(judgement));

  page::Page page = new_page(fmt::format("{}: tracking", base.robot.name), file_name_of(options.scenario));
  page.verdict(fmt::format("Computed torque with the estimated load leaves {:.3g} mrad, with nominal values "
                           "{:.3g} mrad, PD {:.3g} mrad{}.",
                           1e3 * rms(judged[3]), 1e3 * rms(judged[2]), 1e3 * rms(judged[0]),
                           after.empty() ? "" : " after the last payload event"),
               judgement);
  page.paragraph(load_text);
  page.table(tracking_table(counted), "Root mean square tracking error per joint");
  if (!after.empty())
    page.table(tracking_table(after),
               fmt::format("The same from {:.6g} s on, 1 s after the last payload event", settled));
  page.plot(tracking_bars(judged));
  if (!trace->time.empty()) {
    page::PlotSpec spec;
    spec.title = "Estimated mass of the load with its 95 % interval";
    spec.x_label = "time [s]";
    spec.y_label = "mass [kg]";
    double largest = 0.05;
    for (const sim::PayloadEvent& event : base.payload_events)
      largest = std::max(largest, event.grasp ? event.body.mass : 0.0);
    spec.y_range = std::pair<double, double>(-0.6 * largest, 1.8 * largest);
    page::Series interval{"95 % interval", trace->time, {}, {}, page::Style::kBand, page::Hue::kBlue};
    std::vector<double> shown;
    for (std::size_t k = 0; k < trace->mass.size(); ++k) {
      const auto clamped = [&](double v) { return std::clamp(v, spec.y_range->first, spec.y_range->second); };
      interval.y.push_back(clamped(trace->mass[k] - trace->mass_half_width[k]));
      interval.y_high.push_back(clamped(trace->mass[k] + trace->mass_half_width[k]));
      shown.push_back(clamped(trace->mass[k]));
    }
    spec.series = {interval, {"estimate", trace->time, shown, {}, page::Style::kLine, page::Hue::kBlue}};
    spec.marks = marks;
    page.plot(spec);
  }
  std::vector<page::PlotSpec> plots = tracking_plots(runs, marks);
  for (page::PlotSpec& spec : plots) {
    spec.width = 460;
    spec.height = 200;
  }
  page.plots("Tracking error", plots);
  page.note(
      "PD gains are those of computed torque times the mean inertia of each joint, so that all controllers "
      "have the same bandwidth. "
      "The estimated load comes from encoder positions and reported torques while the arm moves; it is "
      "carried into every row "
      "of the model.");
  finish(console, "", options.result, json, page);
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
          "model file with what the controllers believe, effects included; without it the scenario's robot "
          "and friction, without load and effects")
      .type_name("MODEL.json")
      .names_file(FileUse::kInput);
  line.add_option("--from", options->from, "[s] errors count from here on")
      .not_negative()
      .capture_default_str();
  add_result_options(line, options->result);
  line.footer(
      std::string(kScenarioKeys) +
      "Compares PD, PD with gravity, computed torque with nominal values and computed torque with the load "
      "that is\n"
      "estimated while the arm moves. Adaptive control is not in this version.\n"
      "The scenario's controller may be of kind \"track\": bandwidth_hz (3), damping_ratio (1), "
      "friction_feed_forward (true),\n"
      "rows (1: torques of joints k..n go to the estimator), filter_hz (20), mass_prior [kg] (a third of the "
      "arm's mass),\n"
      "torque_residual (per joint, from friction and weight).\n"
      "Effects of the scenario are the arm's alone. With a --model that holds them computed torque feeds "
      "them "
      "forward along\n"
      "the reference. The error of an elastic joint is that of its link.\n"
      "Example: heft track --scenario pick.json --report pick.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
