/// @file
/// heft excite: design a motion that makes the parameters visible.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/identify/excitation.hpp"
#include "heft/identify/judgement.hpp"
#include "heft/report/report.hpp"
#include "heft/sim/settings_reader.hpp"
#include "options.hpp"
#include "page.hpp"
#include "parallel.hpp"

namespace heft::tools {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Options {
  RobotOptions robot;
  ResultOptions result;
  std::string limits;
  std::string output;
  std::string cost{"d-optimal"};
  std::string rows{"torque-limit"};
  std::string torque_at{"motor"};
  bool rotor_inertia{false};
  bool offset{false};
  bool payload_only{false};
  bool no_floor{false};
  std::vector<std::string> given;
  double band{0.0};
  std::vector<double> start;
  double noise_percent{1.0};
  double rate{100.0};
  int compare{20};
  identify::ExcitationOptions design;
};

/// The URDF's limits with those of a file in their place. What the file says about start and noise goes to the
/// design's options.
identify::MotionLimits read_limits(const model::Robot& robot, const std::string& path,
                                   identify::ExcitationOptions& design) {
  identify::MotionLimits limits = identify::limits_of(robot);
  if (path.empty()) return limits;
  const int n = robot.num_joints();
  const sim::SettingsReader reader = sim::SettingsReader::parse(host::read_file(path, "limits"), path);
  const auto take = [&](const char* key, sim::Range range, VectorXd& value) {
    const VectorXd found = reader.numbers_or_none(key, n, range);
    if (found.size() > 0) value = found;
  };
  take("lower", sim::Range::kAny, limits.lower);
  take("upper", sim::Range::kAny, limits.upper);
  take("velocity", sim::Range::kPositive, limits.velocity);
  take("acceleration", sim::Range::kPositive, limits.acceleration);
  take("torque", sim::Range::kPositive, limits.torque);
  for (int j = 0; j < n; ++j) {
    if (limits.lower[j] >= limits.upper[j]) {
      throw ModelError(fmt::format(
          "{}: joint {} ({}): found lower {} and upper {} [rad, m], expected lower < upper; what the "
          "file leaves out comes from the URDF",
          path, j + 1, robot.joints[static_cast<std::size_t>(j)].name, limits.lower[j], limits.upper[j]));
    }
  }
  limits.margin = reader.number_or("margin", limits.margin, sim::Range::kNotNegative);
  limits.clearance = reader.number_or("clearance", limits.clearance, sim::Range::kNotNegative);
  if (reader.has("floor")) {
    if (reader.is_text("floor")) {
      reader.word("floor", {"none"});
      limits.floor.reset();
    } else {
      limits.floor = reader.number("floor");
    }
  }
  if (reader.has("box")) {
    const MatrixXd box = reader.table("box", 2, 3);
    limits.box = std::array<Eigen::Vector3d, 2>{box.row(0), box.row(1)};
  }
  if (reader.has("tool")) limits.tool = reader.numbers("tool", 3);
  take("start", sim::Range::kAny, design.start);
  take("torque_noise", sim::Range::kPositive, design.torque_noise);
  reader.finish();
  return limits;
}

/// Adds the motion of a log to what the design already knows. At most 100 rows a second: neighbouring rows of a
/// faster log move alike.
void add_given(const std::string& path, double band, identify::ExcitationDesign& design) {
  LogOptions options;
  options.band = band;
  data::LogRequirements needs;
  needs.num_joints = design.columns().num_joints();
  needs.robot_name = design.columns().robot().name;
  needs.velocity = needs.acceleration = true;
  needs.min_samples = 10;
  const data::Log log = prepare_log(path, options, needs).log;
  const double rate = data::median_sample_rate(log.time);
  const auto stride = std::max<Index>(1, static_cast<Index>(std::floor(rate / 100.0)));
  const Index rows = (log.num_samples() + stride - 1) / stride;
  MatrixXd q(rows, log.q.cols()), qd = q, qdd = q;
  for (Index i = 0; i < rows; ++i) {
    q.row(i) = log.q.row(i * stride);
    qd.row(i) = log.qd.row(i * stride);
    qdd.row(i) = log.qdd.row(i * stride);
  }
  design.add_given(q, qd, qdd, static_cast<double>(stride) / rate);
}

data::Log log_of(const identify::ExcitationDesign& design, const identify::ExcitationTrajectory& motion,
                 double rate) {
  const auto rows = static_cast<Index>(std::floor(motion.duration * rate + 1e-9)) + 1;
  const Index n = motion.num_joints();
  data::Log log;
  log.time.resize(rows);
  log.q.resize(rows, n);
  log.qd.resize(rows, n);
  log.qdd.resize(rows, n);
  log.tau.resize(rows, n);
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    log.time[i] = static_cast<double>(i) / rate;
    motion.evaluate(log.time[i], q, qd, qdd);
    log.q.row(i) = q;
    log.qd.row(i) = qd;
    log.qdd.row(i) = qdd;
    log.tau.row(i) = design.torque(q, qd, qdd);
  }
  return log;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

nlohmann::ordered_json finite_or_null(double v) {
  return std::isfinite(v) ? nlohmann::ordered_json(v) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json array_of(const Eigen::Ref<const VectorXd>& values) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const double v : values) array.push_back(finite_or_null(v));
  return array;
}

nlohmann::ordered_json rows_of(const MatrixXd& values) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (Index j = 0; j < values.rows(); ++j) array.push_back(array_of(values.row(j).transpose()));
  return array;
}

/// The same motion as a scenario of `simulate` states it: q0 + Σ A sin(2π f t + φ).
nlohmann::ordered_json scenario_reference(const identify::ExcitationTrajectory& motion) {
  // a (1 − cos kωt) / kω + b sin kωt / kω = a / kω + A sin(kωt + φ) with A sin φ = −a / kω, A cos φ = b / kω
  const Index n = motion.num_joints(), K = motion.num_harmonics();
  VectorXd q0 = motion.start;
  MatrixXd amplitude(n, K), frequency(n, K), phase(n, K);
  for (Index k = 0; k < K; ++k) {
    const double f = static_cast<double>(k + 1) / motion.period, w = 2.0 * std::acos(-1.0) * f;
    for (Index j = 0; j < n; ++j) {
      const double a = motion.sine(j, k) / w, b = motion.cosine(j, k) / w;
      q0[j] += a;
      amplitude(j, k) = std::hypot(a, b);
      phase(j, k) = std::atan2(-a, b);
      frequency(j, k) = f;
    }
  }
  return {{"kind", "fourier"},
          {"q0", array_of(q0)},
          {"amplitude", rows_of(amplitude)},
          {"frequency_hz", rows_of(frequency)},
          {"phase", rows_of(phase)}};
}

/// What random motions inside the same limits would tell.
struct Comparison {
  int count{0};
  double condition{0.0}, mean_std{0.0}, volume_std{0.0};  ///< medians
};

Comparison compare(const identify::ExcitationDesign& design, int count) {
  std::vector<identify::ExcitationScore> scores(static_cast<std::size_t>(count));
  Progress progress("random motions for comparison");
  for_each_parallel(
      scores.size(),
      [&](std::size_t i) {
        // Seeds far from those of the search.
        scores[i] = design.score(design.random_motion(design.options().seed + 1'000'003 * (i + 1)));
      },
      [&](double done) { progress.update(done); });
  std::vector<double> condition, mean_std, volume_std;
  for (const identify::ExcitationScore& score : scores) {
    condition.push_back(score.condition);
    mean_std.push_back(score.mean_std);
    volume_std.push_back(score.volume_std);
  }
  return {count, median(condition), median(mean_std), median(volume_std)};
}

std::string percent(double share) { return std::isfinite(share) ? report::number(100.0 * share, 3) : "–"; }

report::Table limit_table(const identify::ExcitationDesign& design, const identify::LimitUse& use) {
  const identify::MotionLimits& limits = design.limits();
  report::Table table({"joint", "from [rad, m]", "to", "% of range", "velocity", "%", "acceleration", "%",
                       "torque [N·m, N]", "%"});
  for (Index j = 0; j < use.velocity.size(); ++j) {
    table.add_row(
        {std::to_string(j + 1), report::number(use.lowest[j], 3), report::number(use.highest[j], 3),
         percent(use.position[j]), report::number(use.velocity[j], 3),
         percent(use.velocity[j] / limits.velocity[j]), report::number(use.acceleration[j], 3),
         std::isfinite(limits.acceleration[j]) ? percent(use.acceleration[j] / limits.acceleration[j]) : "–",
         report::number(use.torque[j], 3),
         std::isfinite(limits.torque[j]) ? percent(use.torque[j] / limits.torque[j]) : "–"});
  }
  return table;
}

report::Table parameter_table(const identify::ExcitationDesign& design,
                              const identify::ExcitationScore& score) {
  report::Table table({"parameter", "unit", "present value", "expected std", "% of value"});
  const VectorXd values = design.values();
  for (Index i = 0; i < score.std.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double share = score.std[i] / std::abs(values[i]);
    table.add_row({design.names()[k], design.units()[k], report::number(values[i], 4),
                   report::number(score.std[i], 3), share < 10.0 ? percent(share) : "–"});
  }
  return table;
}

std::vector<report::PlotSpec> joint_plots(const VectorXd& time, const MatrixXd& values, const VectorXd& lower,
                                          const VectorXd& upper, const std::string& label) {
  std::vector<report::PlotSpec> plots;
  for (Index j = 0; j < values.cols(); ++j) {
    report::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = label;
    spec.series.push_back(report::line("motion", time, values.col(j)));
    const Eigen::Vector2d ends(time[0], time[time.size() - 1]);
    for (const double limit : {lower[j], upper[j]}) {
      if (!std::isfinite(limit)) continue;
      report::Series series =
          report::line("limit", ends, Eigen::Vector2d::Constant(limit), report::Hue::kVermillion);
      series.style = report::Style::kDashed;
      if (spec.series.size() > 1) series.label.clear();  // one entry in the legend
      spec.series.push_back(series);
    }
    plots.push_back(std::move(spec));
  }
  return plots;
}

report::PlotSpec history_plot(const identify::Excitation& design, const std::string& label) {
  report::PlotSpec spec;
  spec.title = "Cost over the winner's search";
  spec.x_label = "iteration";
  spec.y_label = label;
  report::Series series{"", {}, {}};
  for (std::size_t i = 0; i < design.history.size(); ++i) {
    series.x.push_back(static_cast<double>(i));
    series.y.push_back(design.history[i]);
  }
  spec.series.push_back(std::move(series));
  return spec;
}

void run(const Options& options) {
  const Console console{options.output, options.result.json};
  const model::Robot robot = load_robot(options.robot);
  identify::ExcitationOptions design_options = options.design;
  design_options.cost = options.cost == "condition" ? identify::ExcitationCost::kCondition
                                                    : identify::ExcitationCost::kDOptimal;
  design_options.weights =
      options.rows == "unit" ? identify::RowWeights::kUnit : identify::RowWeights::kTorqueLimit;
  const bool friction = options.torque_at == "motor";
  design_options.structure = {options.rotor_inertia, friction, friction, options.offset, {}};
  if (friction) design_options.structure.couplings = robot.couplings;
  design_options.payload_only = options.payload_only;
  design_options.sample_rate = options.rate;
  identify::MotionLimits limits = read_limits(robot, options.limits, design_options);
  if (options.no_floor) limits.floor.reset();
  if (!options.start.empty()) {
    design_options.start =
        Eigen::Map<const VectorXd>(options.start.data(), static_cast<Index>(options.start.size()));
  }
  if (design_options.torque_noise.size() == 0 && limits.torque.allFinite()) {
    design_options.torque_noise = 0.01 * options.noise_percent * limits.torque;
  }
  identify::ExcitationDesign design(robot, limits, design_options);
  for (const std::string& path : options.given) add_given(path, options.band, design);
  const std::optional<identify::ExcitationScore> before = design.given_score();

  identify::Excitation result;
  {
    Progress progress("designing");
    result = design.optimize([&](double done) { progress.update(done); });
  }
  const identify::ExcitationTrajectory& motion = result.trajectory;
  const identify::ExcitationScore& score = result.score;
  const identify::LimitUse use = design.use_of(motion);
  std::optional<Comparison> random;
  if (options.compare > 0) random = compare(design, options.compare);

  // What is said of the result, once for text, page and JSON.
  const bool by_rows = options.rows != "unit";
  const std::string noise_text =
      !limits.torque.allFinite() && design_options.torque_noise.size() == 0
          ? std::string("white torque noise of 1 N·m (N), for want of torque limits")
      : options.limits.empty() ||
              design_options.torque_noise.isApprox(0.01 * options.noise_percent * limits.torque)
          ? fmt::format("white torque noise of {:g} % of each torque limit", options.noise_percent)
          : std::string("white torque noise as the limits file states it");
  const std::string scaling = fmt::format("columns scaled to norm 1, rows {}",
                                          by_rows ? "over the torque noise of their joint" : "as they are");
  const std::string parameters =
      options.payload_only
          ? std::string("of the last link alone, the arm being known")
          : fmt::format("base parameters of rigid bodies{}{}{}", options.rotor_inertia ? ", rotors" : "",
                        friction ? ", Coulomb and viscous friction" : "", options.offset ? ", offsets" : "");
  const std::string std_text = fmt::format("for {} and a row every {:g} ms", noise_text, 1e3 / options.rate);
  const std::string floor_text =
      limits.floor
          ? fmt::format("link origins and tool stay {:.3g} m above the floor at {:.3g} m (nearest: {:.3g} m)",
                        limits.clearance, *limits.floor, use.lowest_height - *limits.floor)
          : std::string("no floor");
  const auto less = [](double value, double reference) { return 100.0 * (1.0 - value / reference); };

  std::string text = fmt::format(
      "{}: {:g} s, {} harmonics of {:g} s, at rest at both ends\n"
      "{} parameters: {}{}\n"
      "Condition number {}: {}; {} with unweighted rows\n"
      "log det F {}; expected standard deviation {} (geometric mean), {}\n",
      robot.name, motion.duration, motion.num_harmonics(), motion.period, design.num_parameters(), parameters,
      options.given.empty()
          ? ""
          : fmt::format("; {} log{} given", options.given.size(), options.given.size() == 1 ? "" : "s"),
      report::number(score.condition, 3), scaling, report::number(score.condition_unit_rows, 3),
      report::number(score.log_det, 4), report::number(score.mean_std, 3), std_text);
  if (before) {
    text += fmt::format("The given logs alone: condition number {}, standard deviation {}: {} % less now\n",
                        report::number(before->condition, 3), report::number(before->mean_std, 3),
                        report::number(less(score.mean_std, before->mean_std), 3));
  } else if (!options.given.empty()) {
    text += "The given logs alone do not determine all of them\n";
  }
  std::string random_text;
  if (random) {
    random_text = fmt::format(
        "{} random motions inside the same limits{}: median condition number {}, standard deviation {}: this "
        "one has "
        "{} % less",
        random->count, options.given.empty() ? "" : ", with the given logs",
        report::number(random->condition, 3), report::number(random->mean_std, 3),
        report::number(less(score.mean_std, random->mean_std), 3));
    text += random_text + '\n';
  }
  const report::Table limit_use = limit_table(design, use);
  text += fmt::format("Limits with {:g} % to spare, {}; nearest: {}\n{}", 100.0 * limits.margin, floor_text,
                      use.worst, limit_use.to_text(2));
  text += "Links are not checked against one another: narrow the position limits where they could meet.\n";

  nlohmann::ordered_json json{{"robot", robot.name},
                              {"duration", motion.duration},
                              {"period", motion.period},
                              {"harmonics", motion.num_harmonics()},
                              {"cost", options.cost},
                              {"seed", design.options().seed},
                              {"parameters", nlohmann::ordered_json::array()},
                              {"columns", parameters},
                              {"condition_number", finite_or_null(score.condition)},
                              {"condition_number_scaling", scaling},
                              {"condition_number_unweighted_rows", finite_or_null(score.condition_unit_rows)},
                              {"log_det", finite_or_null(score.log_det)},
                              {"torque_noise", array_of(design.torque_noise())},
                              {"sample_rate", options.rate},
                              {"std_geometric_mean", finite_or_null(score.mean_std)},
                              {"std_principal_axes_geometric_mean", finite_or_null(score.volume_std)}};
  const VectorXd values = design.values();
  for (Index i = 0; i < score.std.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    json["parameters"].push_back({{"name", design.names()[k]},
                                  {"expression", design.expressions()[k]},
                                  {"unit", design.units()[k]},
                                  {"value", values[i]},
                                  {"std", finite_or_null(score.std[i])}});
  }
  if (!options.given.empty()) {
    json["given"] = {{"logs", options.given},
                     {"condition_number", before ? finite_or_null(before->condition) : nullptr},
                     {"std_geometric_mean", before ? finite_or_null(before->mean_std) : nullptr}};
  }
  if (random) {
    json["random"] = {
        {"count", random->count},
        {"median_condition_number", finite_or_null(random->condition)},
        {"median_std_geometric_mean", finite_or_null(random->mean_std)},
        {"median_std_principal_axes_geometric_mean", finite_or_null(random->volume_std)},
        {"std_reduction_percent", finite_or_null(less(score.mean_std, random->mean_std))},
        {"std_principal_axes_reduction_percent", finite_or_null(less(score.volume_std, random->volume_std))}};
  }
  json["limits"] = {{"margin", limits.margin},
                    {"lower", array_of(limits.lower)},
                    {"upper", array_of(limits.upper)},
                    {"velocity", array_of(limits.velocity)},
                    {"acceleration", array_of(limits.acceleration)},
                    {"torque", array_of(limits.torque)},
                    {"floor", limits.floor ? finite_or_null(*limits.floor) : nullptr},
                    {"clearance", limits.clearance}};
  json["reached"] = {{"lowest", array_of(use.lowest)},
                     {"highest", array_of(use.highest)},
                     {"velocity", array_of(use.velocity)},
                     {"acceleration", array_of(use.acceleration)},
                     {"torque", array_of(use.torque)},
                     {"lowest_height", finite_or_null(use.lowest_height)},
                     {"box_distance", finite_or_null(use.box_distance)},
                     {"nearest", use.worst},
                     {"inside", use.inside}};
  json["trajectory"] = {{"start", array_of(motion.start)},
                        {"sine", rows_of(motion.sine)},
                        {"cosine", rows_of(motion.cosine)},
                        {"reference", scenario_reference(motion)}};
  json["costs_of_starts"] =
      array_of(Eigen::Map<const VectorXd>(result.costs.data(), static_cast<Index>(result.costs.size())));
  json["history"] = result.history;

  const data::Log log = log_of(design, motion, options.rate);
  const host::Judgement judgement = identify::judge_condition(score.condition);
  put_verdict(json, judgement);
  report::Report page = new_page(
      fmt::format("{}: exciting motion", robot.name),
      fmt::format("{:g} s, {} harmonics of {:g} s", motion.duration, motion.num_harmonics(), motion.period));
  page.verdict(fmt::format("{} parameters at a condition number of {}.", design.num_parameters(),
                           report::number(score.condition, 3)),
               judgement);
  page.facts({{"condition number", report::number(score.condition, 3), scaling},
              {"expected standard deviation", report::number(score.mean_std, 3),
               "geometric mean over the parameters"},
              {"log det F", report::number(score.log_det, 4), "natural logarithm"},
              {"margin", fmt::format("{:g} %", 100.0 * limits.margin), "nearest: " + use.worst}});
  page.paragraph(fmt::format("Parameters: {}. Standard deviations {}. {}", parameters, std_text,
                             random ? random_text + "." : ""));
  page.heading("Limits");
  page.table(limit_use,
             fmt::format("Largest values on the way and their share of the limit; {}.", floor_text));
  page.note(
      "Torque is what the model predicts, friction included; the design keeps it inside its limit for "
      "friction of "
      "either sign. Links are not checked against one another.");
  page.heading("Motion");
  page.plots("Position", joint_plots(log.time, log.q, limits.lower, limits.upper, "position [rad, m]"));
  page.plots("Velocity",
             joint_plots(log.time, log.qd, -limits.velocity, limits.velocity, "velocity [rad/s, m/s]"));
  page.plots("Acceleration", joint_plots(log.time, log.qdd, -limits.acceleration, limits.acceleration,
                                         "acceleration [rad/s², m/s²]"));
  page.plots("Torque", joint_plots(log.time, log.tau, -limits.torque, limits.torque, "torque [N·m, N]"));
  page.heading("Search");
  page.plot(history_plot(result, options.cost == "condition" ? "log condition number" : "−log det F / 2b"));
  page.heading("Parameters");
  page.table(parameter_table(design, score), "Present values are those of the robot's description.");

  console.print("{}", text);
  finish(console, options.output, options.result, json, page, [&] { data::write_log(options.output, log); });
}

}  // namespace

Action set_up_excite(CommandLine line) {
  auto options = std::make_shared<Options>();
  identify::ExcitationOptions& design = options->design;
  add_robot_options(line, options->robot);
  line.add_option("--limits", options->limits, "limits that replace those of the URDF, and more (see below)")
      .type_name("LIMITS.json")
      .names_file(FileUse::kInput);
  line.add_option("--duration", design.duration, "[s]").type_name("S").positive().capture_default_str();
  line.add_option("--period", design.period, "[s] of the first harmonic (default: the duration)")
      .type_name("S")
      .positive();
  line.add_option("--harmonics", design.harmonics, "a joint")
      .type_name("N")
      .between(1, 100)
      .capture_default_str();
  line.add_option("--cost", options->cost,
                  "d-optimal (smallest standard deviations) or condition (smallest condition number)")
      .type_name("COST")
      .one_of({"d-optimal", "condition"})
      .capture_default_str();
  line.add_option("--rows", options->rows,
                  "weight of a joint's rows: torque-limit (1 over its torque noise) or unit")
      .type_name("WEIGHT")
      .one_of({"torque-limit", "unit"})
      .capture_default_str();
  line.add_option(
          "--torque-at", options->torque_at,
          "where torque will be measured: motor (with friction columns) or joint (a sensor behind the gear: "
          "rigid bodies only)")
      .type_name("WHERE")
      .one_of({"motor", "joint"})
      .capture_default_str();
  line.add_flag("--rotor-inertia", options->rotor_inertia, "rotor inertias are sought too");
  line.add_flag("--offset", options->offset, "torque offsets are sought too");
  line.add_flag("--payload-only", options->payload_only,
                "the arm is known; only the last link's ten are sought");
  line.add_option("--given", options->given,
                  "log already taken, to which this motion is to add; may be given several times")
      .type_name("LOG.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--band", options->band, "low-pass for derived motion of given logs [Hz] (default: chosen)")
      .type_name("HZ")
      .positive();
  line.add_option("--start", options->start, "position at both ends (default: free)")
      .type_name("Q,Q,...")
      .delimiter(',');
  line.add_flag("--no-floor", options->no_floor, "no floor");
  line.add_option("--noise", options->noise_percent, "torque noise [% of the torque limit]")
      .type_name("PERCENT")
      .positive()
      .capture_default_str();
  line.add_option("--rate", options->rate, "rows a second of the output [Hz]")
      .type_name("HZ")
      .positive()
      .capture_default_str();
  line.add_option("--starts", design.starts, "random motions to search from")
      .type_name("N")
      .between(1, 10000)
      .capture_default_str();
  line.add_option("--seed", design.seed, "of the random motions").type_name("N").capture_default_str();
  line.add_option("--threads", design.threads, "(default: one a processor; the result does not depend on it)")
      .type_name("N")
      .between(1, 256);
  line.add_option("--compare", options->compare, "random motions inside the same limits to compare with")
      .type_name("N")
      .between(0, 100000)
      .capture_default_str();
  add_output_option(line, options->output,
                    "motion (CSV): time, q*, qd*, qdd*, tau* (predicted torque); - is standard output");
  add_result_options(line, options->result);
  line.footer(
      "A finite Fourier series per joint, at rest at both ends, inside all limits. Joints, start and weights "
      "may be "
      "set in\n"
      "LIMITS.json; one number stands for all joints, what is left out comes from the URDF:\n"
      "  lower, upper    [rad, m]     velocity, acceleration, torque   [rad/s, rad/s², N·m; m, N]\n"
      "  margin          share of every limit to spare (0.05)\n"
      "  floor           [m] above the base origin that link origins and tool stay above, or \"none\" (0; "
      "none for a\n"
      "                  base that hangs or leans by more than 45°)\n"
      "  clearance       [m] distance kept from floor and box (5 % of the arm's length, for the housings)\n"
      "  box             [[x, y, z], [x, y, z]] corners in the base frame\n"
      "  tool            [x, y, z] a point in the tip frame that keeps clear as well\n"
      "  start           position at both ends     torque_noise    standard deviation [N·m, N]\n"
      "Links are not checked against one another.\n"
      "The JSON holds the motion's coefficients, and the same as \"reference\" of a scenario of heft "
      "simulate.\n"
      "Example: heft excite --urdf ur10e --duration 20 --report exciting.html -o exciting.csv");
  return [options] { run(*options); };
}

}  // namespace heft::tools
