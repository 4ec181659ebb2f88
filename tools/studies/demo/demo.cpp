#include "demo.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heft/host/parallel.hpp"
#include "heft/model/named_arms.hpp"
#include "heft/model/robot_of.hpp"
#include "heft/page/origin.hpp"
#include "heft/report/verdict.hpp"
#include "heft/sim/simulator.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/track/controllers.hpp"
#include "heft/validate/judgement.hpp"
#include "host/json.hpp"
#include "operation_count_line.hpp"

namespace heft::studies {
namespace {

constexpr double kDuration = 15.0;
constexpr double kGrasp = 6.0;
constexpr double kSettled = 2.0;  // after a start or a grasp, before errors are counted [s]

/// The UR5 with drives: rotors, torque limits.
model::Robot demo_robot() {
  model::Robot robot = model::robot_of(model::Ur5Arm::kModel, "ur5");
  constexpr std::array<double, 6> kRotor = {0.6, 0.6, 0.5, 0.1, 0.1, 0.1};
  constexpr std::array<double, 6> kEffort = {150, 150, 150, 28, 28, 28};
  for (std::size_t i = 0; i < 6; ++i) {
    robot.joints[i].actuation.rotor_inertia = kRotor[i];
    robot.joints[i].effort_limit = kEffort[i];
  }
  return robot;
}

/// The arm as the controller knows it: rigid bodies as identified, friction some percent off.
model::Robot believed_robot(const model::Robot& robot) {
  model::Robot believed = robot;
  constexpr std::array<double, 6> kOff = {1.05, 0.95, 1.04, 0.94, 1.06, 0.96};
  for (std::size_t i = 0; i < 6; ++i) {
    believed.joints[i].actuation.coulomb_friction *= kOff[i];
    believed.joints[i].actuation.viscous_friction *= kOff[5 - i];
  }
  return believed;
}

sim::Body demo_load(double mass) {
  sim::Body body;
  body.mass = mass;
  body.com = Eigen::Vector3d(0.03, -0.02, 0.14);
  // A block of 14 × 10 × 8 cm.
  body.inertia =
      mass / 12 *
      Eigen::Vector3d(0.10 * 0.10 + 0.08 * 0.08, 0.14 * 0.14 + 0.08 * 0.08, 0.14 * 0.14 + 0.10 * 0.10)
          .asDiagonal();
  return body;
}

std::shared_ptr<const sim::Reference> demo_path() {
  sim::FourierMotion motion;
  motion.q0.resize(6);
  motion.amplitude.resize(6, 2);
  motion.frequency_hz.resize(6, 2);
  motion.phase.resize(6, 2);
  motion.q0 << 0.0, -1.2, 1.3, -0.5, 1.0, 0.2;
  motion.amplitude << 0.50, 0.10, 0.30, 0.08, 0.35, 0.08, 0.50, 0.12, 0.60, 0.12, 0.70, 0.15;
  motion.frequency_hz << 0.20, 0.75, 0.25, 0.65, 0.30, 0.80, 0.35, 0.90, 0.40, 0.85, 0.45, 0.70;
  motion.phase << 0.0, 1.0, 0.5, 0.0, 1.0, 2.0, 1.5, 0.3, 2.0, 0.1, 2.5, 1.2;
  const Eigen::VectorXd start = motion.q0;
  return sim::ramp_in(sim::make_fourier(motion), start, 1.5);
}

struct Run {
  Eigen::VectorXd time;
  Eigen::MatrixXd error;  ///< reference minus position [rad]
  Eigen::MatrixXd torque;
};

/// Root mean square over all joints between two times [rad].
double rms_between(const Run& run, double from, double to) {
  double sum = 0;
  int count = 0;
  for (Eigen::Index k = 0; k < run.time.size(); ++k) {
    if (run.time[k] < from || run.time[k] >= to) continue;
    sum += run.error.row(k).squaredNorm() / static_cast<double>(run.error.cols());
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0.0;
}

/// Length of the error over time, smoothed over a tenth of a second so that the eye sees its level.
Eigen::VectorXd error_level(const Run& run) {
  const Eigen::Index window = 100;
  Eigen::VectorXd level(run.time.size());
  double sum = 0;
  for (Eigen::Index k = 0; k < run.time.size(); ++k) {
    sum += run.error.row(k).squaredNorm();
    if (k >= window) sum -= run.error.row(k - window).squaredNorm();
    const double count = static_cast<double>(std::min(k + 1, window) * run.error.cols());
    level[k] = 1e3 * std::sqrt(std::max(0.0, sum) / count);
  }
  return level;
}

page::Mark grasp_mark() { return {page::Mark::Direction::kVertical, kGrasp, "grasp"}; }

/// What the two runs gave.
struct DemoResult {
  std::string robot;
  sim::Body load;
  Run without, with;  ///< the load's estimate in the controller's model
  track::LoadTrace trace;
  double mass{0.0}, half{0.0};              ///< found, and half of its 95 % interval [kg]
  std::array<double, 3> com{}, com_half{};  ///< the same [m]
  double found_at{0.0}, noticed_at{0.0};    ///< since the grasp [s]
  /// Root mean square tracking error [rad] before the grasp, and after it without and with the estimate.
  double before{0.0}, after_without{0.0}, after_with{0.0};
  host::Judgement judgement;
  std::string operations;  ///< what a sample of the estimator costs
};

sim::SimulationSettings demo_settings(const model::Robot& robot, const sim::Body& load) {
  sim::SimulationSettings settings;
  settings.robot = robot;
  settings.duration = kDuration;
  settings.loads = sim::friction_of(robot);
  settings.torque_limit = sim::effort_limits_of(robot);
  settings.reference = demo_path();
  settings.initial_position.resize(6);
  settings.initial_velocity.resize(6);
  Eigen::VectorXd acceleration(6);
  settings.reference->evaluate(0.0, settings.initial_position, settings.initial_velocity, acceleration);
  sim::PayloadEvent grasp;
  grasp.time = kGrasp;
  grasp.body = load;
  settings.payload_events = {grasp};
  settings.sensors.encoder_quantum = Eigen::VectorXd::Constant(6, 2e-5);
  settings.sensors.velocity = sim::VelocitySource::kDifferenced;
  settings.sensors.velocity_cutoff_hz = 100;
  settings.sensors.torque_noise = (Eigen::VectorXd(6) << 0.5, 0.5, 0.5, 0.1, 0.1, 0.1).finished();
  settings.seed = 1;
  return settings;
}

DemoResult simulate(double mass, const std::function<void(double)>& progress) {
  const model::Robot robot = demo_robot();
  const model::Robot believed = believed_robot(robot);
  const sim::Body load = demo_load(mass);
  const sim::SimulationSettings settings = demo_settings(robot, load);

  track::ControllerSettings tracking;
  tracking.bandwidth_hz = 3;
  tracking.torque_limit = settings.torque_limit;
  tracking.inertia = track::mean_inertia(believed, *settings.reference, kDuration);

  DemoResult d;
  d.robot = robot.name;
  d.load = load;
  const auto trace = std::make_shared<track::LoadTrace>();
  host::for_each_parallel(
      2,
      [&](std::size_t i) {
        const bool estimates = i == 1;
        sim::SimulationSettings own = settings;
        own.controller =
            track::make_controller(estimates ? track::Method::kEstimated : track::Method::kComputedTorque,
                                   believed, tracking, estimates ? trace : nullptr);
        const data::Log log = sim::simulate(own).log;
        Run& run = estimates ? d.with : d.without;
        run = {log.time, log.qref - log.q, log.tau};
      },
      progress);
  d.trace = *trace;

  d.mass = trace->mass.back();
  d.half = trace->mass_half_width.back();
  d.com = trace->com.back();
  d.com_half = trace->com_half_width.back();
  d.found_at = trace->settled_at() - kGrasp;
  const auto noticed =
      std::find_if(trace->change.begin(), trace->change.end(), [](double t) { return t > kGrasp; });
  d.noticed_at =
      noticed == trace->change.end() ? std::numeric_limits<double>::quiet_NaN() : *noticed - kGrasp;
  d.before = rms_between(d.with, kSettled, kGrasp);
  d.after_without = rms_between(d.without, kGrasp + kSettled, kDuration);
  d.after_with = rms_between(d.with, kGrasp + kSettled, kDuration);
  d.judgement = validate::judge_against_truth("the mass", d.mass, d.half, load.mass);
  d.judgement.add(validate::judge_improvement("the tracking error with the estimated load", d.after_with,
                                              "that without it", d.after_without));
  d.operations = operation_count_line();
  return d;
}

std::string text_of(const DemoResult& d) {
  std::string text;
  text += fmt::format(
      "The load weighs {:.3f} kg ± {:.3f} kg (in truth {:.3f} kg), found {:.2f} s after the grasp.\n", d.mass,
      d.half, d.load.mass, d.found_at);
  text += fmt::format("Centre of mass {:.0f}, {:.0f}, {:.0f} mm (in truth {:.0f}, {:.0f}, {:.0f}).\n",
                      1e3 * d.com[0], 1e3 * d.com[1], 1e3 * d.com[2], 1e3 * d.load.com[0],
                      1e3 * d.load.com[1], 1e3 * d.load.com[2]);
  text += fmt::format(
      "Tracking error: {:.2f} mrad before the grasp; after it {:.2f} mrad without, {:.2f} mrad with the "
      "estimated load.\n",
      1e3 * d.before, 1e3 * d.after_without, 1e3 * d.after_with);
  if (!d.operations.empty()) text += fmt::format("{}\n", d.operations);
  return text;
}

nlohmann::ordered_json json_of(const DemoResult& d) {
  const auto number = host::number_or_null;
  nlohmann::ordered_json json{
      {"robot", d.robot},
      {"grasp_time", kGrasp},
      {"mass",
       {{"value", number(d.mass)},
        {"half_width_95", number(d.half)},
        {"std", number(d.half / statistics::kNormal95)},
        {"identifiable", std::isfinite(d.half) && d.half < 0.5 * std::abs(d.mass)},
        {"true", d.load.mass}}},
      {"com",
       {{"value", {number(d.com[0]), number(d.com[1]), number(d.com[2])}},
        {"half_width_95", {number(d.com_half[0]), number(d.com_half[1]), number(d.com_half[2])}},
        {"true", {d.load.com[0], d.load.com[1], d.load.com[2]}}}},
      {"noticed_after", number(d.noticed_at)},
      {"converged_after", number(d.found_at)},
      {"rms_tracking_error",
       {{"before_grasp", d.before},
        {"after_grasp_uncorrected", d.after_without},
        {"after_grasp_corrected", d.after_with}}},
      {"report", ""}};
  json.update(as_json(report::verdict_json(d.judgement)));
  if (!d.operations.empty()) json["operations"] = d.operations;
  return json;
}

void add_answer(const DemoResult& d, page::Page& page) {
  page.verdict(
      fmt::format("The load weighs {:.3f} kg ± {:.3f} kg (in truth {:.3f} kg). With it in the model "
                  "the tracking error falls from {:.2f} to {:.2f} mrad; it was {:.2f} mrad before "
                  "the grasp.",
                  d.mass, d.half, d.load.mass, 1e3 * d.after_without, 1e3 * d.after_with, 1e3 * d.before),
      d.judgement);
  page.facts({{"mass found", fmt::format("{:.3f} kg", d.mass),
               fmt::format("± {:.3f}, in truth {:.3f}", d.half, d.load.mass)},
              {"centre of mass [mm]",
               fmt::format("{:.0f}, {:.0f}, {:.0f}", 1e3 * d.com[0], 1e3 * d.com[1], 1e3 * d.com[2]),
               fmt::format("± {:.0f}, {:.0f}, {:.0f}; in truth {:.0f}, {:.0f}, {:.0f}", 1e3 * d.com_half[0],
                           1e3 * d.com_half[1], 1e3 * d.com_half[2], 1e3 * d.load.com[0], 1e3 * d.load.com[1],
                           1e3 * d.load.com[2])},
              {"time to find it", fmt::format("{:.2f} s", d.found_at),
               fmt::format("noticed after {:.2f} s; then within 5 % for good", d.noticed_at)},
              {"tracking error", fmt::format("÷ {:.1f}", d.after_without / d.after_with),
               "after the grasp, with the load in the model"}});
}

page::PlotSpec mass_plot_of(const DemoResult& d) {
  page::PlotSpec mass_plot;
  mass_plot.title = "Estimated mass of the load with its 95 % interval";
  mass_plot.x_label = "time [s]";
  mass_plot.y_label = "mass [kg]";
  mass_plot.height = 340;
  mass_plot.y_range = std::pair<double, double>(-0.5 * d.load.mass, 2.0 * d.load.mass);
  {
    page::Series interval{"95 % interval", d.trace.time, {}, {}, page::Style::kBand, page::Hue::kBlue};
    const double lowest = mass_plot.y_range->first, highest = mass_plot.y_range->second;
    for (std::size_t k = 0; k < d.trace.mass.size(); ++k) {
      interval.y.push_back(std::clamp(d.trace.mass[k] - d.trace.mass_half_width[k], lowest, highest));
      interval.y_high.push_back(std::clamp(d.trace.mass[k] + d.trace.mass_half_width[k], lowest, highest));
    }
    mass_plot.series.push_back(interval);
    mass_plot.series.push_back(
        {"estimate", d.trace.time, d.trace.mass, {}, page::Style::kLine, page::Hue::kBlue});
    mass_plot.series.push_back({"truth",
                                {0, kGrasp, kGrasp, kDuration},
                                {0, 0, d.load.mass, d.load.mass},
                                {},
                                page::Style::kDashed,
                                page::Hue::kNeutral});
  }
  mass_plot.marks = {grasp_mark()};
  return mass_plot;
}

page::PlotSpec error_plot_of(const DemoResult& d) {
  page::PlotSpec error_plot;
  error_plot.title = "Tracking error of the whole arm (rms over joints and a tenth of a second)";
  error_plot.x_label = "time [s]";
  error_plot.y_label = "error [mrad]";
  error_plot.height = 340;
  error_plot.series = {
      page::line("without the load in the model", d.without.time, error_level(d.without),
                 page::Hue::kVermillion),
      page::line("with the estimated load", d.with.time, error_level(d.with), page::Hue::kBlue)};
  error_plot.marks = {grasp_mark()};
  return error_plot;
}

/// Tracking errors joint by joint: plots, table, JSON.
void add_joints(const DemoResult& d, page::Page& page, nlohmann::ordered_json& json) {
  page::Table table(
      {"joint", "before the grasp [mrad]", "after, uncorrected [mrad]", "after, corrected [mrad]"});
  nlohmann::ordered_json per_joint = nlohmann::ordered_json::array();
  std::vector<page::PlotSpec> small;
  for (int j = 0; j < 6; ++j) {
    const Run one_with{d.with.time, d.with.error.col(j), {}},
        one_without{d.without.time, d.without.error.col(j), {}};
    const double b = rms_between(one_with, kSettled, kGrasp),
                 u = rms_between(one_without, kGrasp + kSettled, kDuration),
                 c = rms_between(one_with, kGrasp + kSettled, kDuration);
    table.add_row({fmt::format("{}", j + 1), fmt::format("{:.2f}", 1e3 * b), fmt::format("{:.2f}", 1e3 * u),
                   fmt::format("{:.2f}", 1e3 * c)});
    per_joint.push_back({{"joint", j + 1},
                         {"before_grasp", b},
                         {"after_grasp_uncorrected", u},
                         {"after_grasp_corrected", c}});
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "error [mrad]";
    spec.width = 460;
    spec.height = 200;
    spec.series = {
        page::line("without the load in the model", d.without.time, 1e3 * d.without.error.col(j),
                   page::Hue::kVermillion),
        page::line("with the estimated load", d.with.time, 1e3 * d.with.error.col(j), page::Hue::kBlue)};
    spec.marks = {grasp_mark()};
    small.push_back(spec);
  }
  table.add_row({"all", fmt::format("{:.2f}", 1e3 * d.before), fmt::format("{:.2f}", 1e3 * d.after_without),
                 fmt::format("{:.2f}", 1e3 * d.after_with)});
  json["per_joint"] = per_joint;
  page.plots("Tracking error, joint by joint", small);
  page.heading("In numbers");
  page.table(
      table,
      fmt::format("Root mean square tracking error from {:.0f} s after the start or the grasp on", kSettled));
}

std::vector<page::PlotSpec> com_plots_of(const DemoResult& d) {
  std::vector<page::PlotSpec> com_plots;
  for (std::size_t a = 0; a < 3; ++a) {
    page::PlotSpec spec;
    spec.title = fmt::format("Centre of mass, {}", "xyz"[a]);
    spec.x_label = "time [s]";
    spec.y_label = "[mm]";
    spec.width = 460;
    spec.height = 200;
    std::vector<double> time, value, low, high;
    for (std::size_t k = 0; k < d.trace.time.size(); ++k) {
      if (d.trace.time[k] < kGrasp) continue;
      time.push_back(d.trace.time[k]);
      value.push_back(1e3 * d.trace.com[k][a]);
      low.push_back(1e3 * (d.trace.com[k][a] - d.trace.com_half_width[k][a]));
      high.push_back(1e3 * (d.trace.com[k][a] + d.trace.com_half_width[k][a]));
    }
    const double truth = 1e3 * d.load.com[static_cast<Eigen::Index>(a)];
    for (std::size_t k = 0; k < low.size(); ++k) {
      low[k] = std::clamp(low[k], truth - 60, truth + 60);
      high[k] = std::clamp(high[k], truth - 60, truth + 60);
    }
    spec.series = {{"95 % interval", time, low, high, page::Style::kBand, page::Hue::kBlue},
                   {"estimate", time, value, {}, page::Style::kLine, page::Hue::kBlue}};
    spec.y_range = std::pair<double, double>(truth - 60, truth + 60);
    spec.marks = {{page::Mark::Direction::kHorizontal, truth, "truth"}};
    com_plots.push_back(spec);
  }
  return com_plots;
}

void add_notes(const DemoResult& d, page::Page& page) {
  if (!d.operations.empty()) page.note(d.operations);
  page.note(
      "Encoders of 2e-5 rad, velocity from differences, torque noise of 0.5 and 0.1 N·m; the controller "
      "knows the rigid bodies of the arm and its friction to about 5 %.");
  page.note(
      "The estimator sees encoder positions and the torque the drives report, nothing else. Positions pass "
      "a causal filter that gives velocity and acceleration, the torque passes the same filter; the "
      "residual of the arm's own model is explained by ten inertial parameters of a body at the last link "
      "and a change of the last joint's friction, by recursive least squares. Residuals several times their "
      "usual size over some samples indicate another load; the estimate is then reset and the new load is "
      "weighed. The interval (95 %) is from the residuals' own size and correlation.");
}

}  // namespace

StudyReport run_demo(double mass, const std::function<void(double)>& progress) {
  const DemoResult d = simulate(mass, progress);
  StudyReport report{
      page::new_page(
          "An arm picks up an unknown load",
          fmt::format(
              "A simulated UR5 under computed torque at 1 kHz; {} kg in the gripper from {:.0f} s on.",
              d.load.mass, kGrasp)),
      text_of(d),
      {},
      {},
      {},
      json_of(d)};
  add_answer(d, report.page);
  report.page.plot(mass_plot_of(d));
  report.page.plot(error_plot_of(d));
  add_joints(d, report.page, report.json);
  report.page.plots("Position of the load, in the axes of the last link", com_plots_of(d));
  add_notes(d, report.page);
  return report;
}

}  // namespace heft::studies
