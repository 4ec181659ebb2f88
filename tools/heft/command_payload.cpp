/// @file
/// heft payload: the load at the flange, estimated sample by sample over a log.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "console.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/model_file.hpp"
#include "heft/page/page.hpp"
#include "heft/payload/judgement.hpp"
#include "heft/payload/payload_run.hpp"
#include "heft/payload/recursive_fit.hpp"
#include "heft/validate/judgement.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "payload_result.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::vector<std::string> baselines;
  std::vector<std::string> zeros;
  std::string output;
  int rows{1};
  double true_mass{0.0};
};

/// The arm without load as the estimator is told of it.
struct Arm {
  model::Robot robot;
  std::optional<statistics::ResidualStatistics> residual;
  std::optional<Eigen::MatrixXd> covariance;
};

constexpr const char* kResidualField = "residual";

/// A log for people who look at it afterwards, and the same as the estimator may see it.
struct Recording {
  data::Log derived;  ///< qd, qdd filled in with zero phase where the log lacks them
  data::Log causal;   ///< only what was measured
  host::Judgement torque;
};

Recording read_recording(const std::string& path, const LogOptions& options, const model::Robot& robot) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.velocity = needs.acceleration = needs.torque = true;
  PreparedLog prepared = prepare_log(path, options, needs);
  data::refuse_errors(data::check_log(prepared.log, limits_of(robot)));
  host::Judgement torque = judge_torque(prepared.log, robot, options, options.measured_at());
  Recording recording{prepared.log, std::move(prepared.log), std::move(torque)};
  if (prepared.motion.velocity_derived) recording.causal.qd.resize(0, 0);
  return recording;
}

Eigen::VectorXd numbers(const nlohmann::ordered_json& json, const char* key, int size,
                        const std::string& path) {
  const auto list = json.value(key, nlohmann::ordered_json());
  if (!list.is_array() || list.size() != static_cast<std::size_t>(size)) {
    throw ModelError(
        fmt::format("{}: /{}/{}: expected {} numbers, one a joint", path, kResidualField, key, size));
  }
  Eigen::VectorXd values(size);
  for (int i = 0; i < size; ++i) {
    const auto& entry = list[static_cast<std::size_t>(i)];
    if (!entry.is_number() || !(entry.get<double>() > 0)) {
      throw ModelError(
          fmt::format("{}: /{}/{}/{}: found {}; expected a number above 0", path, kResidualField, key, i,
                      entry.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)));
    }
    values[i] = entry.get<double>();
  }
  return values;
}

/// What a fit of heft wrote about the residual of its model; nothing for models from elsewhere.
std::optional<statistics::ResidualStatistics> residual_of(const model::ModelFile& file) {
  if (file.other_fields.empty()) return std::nullopt;
  const auto others = nlohmann::ordered_json::parse(file.other_fields);
  if (!others.contains(kResidualField)) return std::nullopt;
  const auto& json = others[kResidualField];
  statistics::ResidualStatistics residual;
  residual.std = numbers(json, "std", file.num_joints(), file.path);
  residual.correlation_time = numbers(json, "correlation_time", file.num_joints(), file.path);
  const auto cutoff = json.value("cutoff_hz", nlohmann::ordered_json());
  if (!cutoff.is_number() || !(cutoff.get<double>() > 0)) {
    throw ModelError(fmt::format("{}: /{}/cutoff_hz: expected a number above 0", file.path, kResidualField));
  }
  residual.cutoff = cutoff.get<double>();
  return residual;
}

void keep_residual(model::ModelFile& file, const statistics::ResidualStatistics& residual) {
  nlohmann::ordered_json others = file.other_fields.empty()
                                      ? nlohmann::ordered_json::object()
                                      : nlohmann::ordered_json::parse(file.other_fields);
  others[kResidualField] = {{"std", json_array(residual.std)},
                            {"correlation_time", json_array(residual.correlation_time)},
                            {"cutoff_hz", residual.cutoff}};
  file.other_fields = others.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

payload::RecursiveFit fit(const model::Robot& robot, const std::vector<data::Log>& logs,
                          const Options& options, const std::string& what) {
  Progress progress(what);
  payload::RecursiveFitOptions fit_options;
  fit_options.cutoff = options.log.band;
  fit_options.torque_at_joint = options.log.measured_at() == TorqueAt::kJoint;
  fit_options.progress = [&](double done) { progress.update(done); };
  payload::RecursiveFit result = payload::fit_recursively(robot, logs, fit_options);
  if (!result.missing.empty()) {
    std::string names;
    for (const data::Log& log : logs) names += fmt::format("{}{}", names.empty() ? "" : ", ", log.path);
    throw NotIdentifiableError(fmt::format("{}: no model can be fitted: {}", names, result.missing.front()));
  }
  return result;
}

Arm arm_of(const model::Robot& robot, const payload::RecursiveFit& fitted) {
  Arm arm{robot, fitted.residual, fitted.model.covariance};
  model::apply(fitted.model, arm.robot);
  return arm;
}

payload::PayloadRun estimate(const Arm& arm, const data::Log& log, const Options& options,
                             double zero_mass_std) {
  Progress progress(log.path);
  payload::PayloadRunOptions run;
  run.first_joint = options.rows;
  run.cutoff = options.log.band;
  run.torque_at_joint = options.log.measured_at() == TorqueAt::kJoint;
  run.residual = arm.residual;
  run.model_covariance = arm.covariance;
  run.zero_mass_std = zero_mass_std;
  run.progress = [&](double done) { progress.update(done); };
  return payload::run_payload(arm.robot, log, run);
}

/// Torque that a model expects; the sign of friction goes through zero within 0.005 rad/s, so that a joint
/// that stands still with a noisy velocity has none.
Eigen::MatrixXd predict(const model::Robot& robot, const data::Log& log, bool at_motor) {
  constexpr double kSignWidth = 0.005;
  const model::Dynamics dynamics(robot);
  Eigen::MatrixXd torque(log.num_samples(), robot.num_joints());
  for (int k = 0; k < log.num_samples(); ++k) {
    const Eigen::VectorXd q = log.q.row(k), qd = log.qd.row(k), qdd = log.qdd.row(k);
    if (at_motor) {
      torque.row(k) = dynamics.joint_torque(q, qd, qdd, kSignWidth);
      continue;
    }
    torque.row(k) = dynamics.inverse_dynamics(q, qd, qdd);
    for (int i = 0; i < robot.num_joints(); ++i) {
      torque(k, i) += robot.joints[static_cast<std::size_t>(i)].actuation.friction_offset;
    }
  }
  return torque;
}

/// The robot with the load found at its last link, and with the friction as found.
model::Robot loaded(const model::Robot& robot, const payload::PayloadRun& run, bool with_friction) {
  model::Robot result = robot;
  for (std::size_t i = 0; i < 10; ++i) result.joints.back().link[i] += run.on_last_link[i];
  if (!with_friction) return result;
  for (std::size_t i = 0; i < result.joints.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (run.coulomb_change.identifiable[i])
      result.joints[i].actuation.coulomb_friction += run.coulomb_change.value[at];
    if (run.viscous_change.identifiable[i])
      result.joints[i].actuation.viscous_friction += run.viscous_change.value[at];
  }
  return result;
}

Estimate shown(const payload::Estimated& estimated) {
  return {estimated.value, estimated.std, estimated.identifiable, estimated.half_width};
}

std::string frame_name(const model::Robot& robot) {
  const bool at_link = robot.tip_link == robot.joints.back().link_name;
  return at_link ? fmt::format("the frame of the last link, {}", robot.tip_link)
                 : fmt::format("the frame of {}", robot.tip_link);
}

/// The mass is told; or all first moments are, where the rows asked for cannot show the mass.
bool is_answered(const payload::PayloadRun& run) {
  const auto& known = run.first_moment.identifiable;
  return run.mass.identifiable[0] ||
         (!run.mass_visible && std::all_of(known.begin(), known.end(), [](bool told) { return told; }));
}

struct Shown {
  PayloadResult result;
  std::vector<page::PlotSpec> residual_plots;
};

Shown present(const Arm& arm, const Recording& recording, const payload::PayloadRun& run,
              const Options& options) {
  const bool at_motor = options.log.measured_at() == TorqueAt::kMotor;
  const data::Log& log = recording.derived;
  Shown shown_run;
  PayloadResult& result = shown_run.result;
  result.robot = arm.robot.name;
  result.log = log.path;
  result.rows = run.first_joint;
  result.samples = run.samples;
  result.mass = shown(run.mass);
  result.first_moment = shown(run.first_moment);
  result.com = shown(run.com);
  result.inertia = shown(run.inertia);
  result.torque_scale = shown(run.torque_scale);
  result.judgement = payload::judge(run);
  result.judgement.add(recording.torque);
  result.contradicts_itself = !payload::contradiction(run).empty();
  result.frame = frame_name(arm.robot);
  result.converged_at = run.converged_at;
  for (const payload::LoadChange& change : run.changes) {
    result.changes.push_back({change.time, change.mass, change.mass_before, change.std});
  }
  if (options.true_mass > 0) {
    result.true_mass = options.true_mass;
    if (run.mass.identifiable[0]) {
      result.judgement.add(validate::judge_against_truth("the mass", run.mass.value[0],
                                                         run.mass.half_width[0], options.true_mass));
    }
  }
  result.missing = run.missing;
  result.cutoff = run.cutoff;
  result.mass_std_parts = {{"this log's residual", run.mass_std_residual},
                           {"model", run.mass_std_model},
                           {"zero check", run.mass_std_zero}};
  result.blocks = run.blocks;
  result.block_length = run.block;
  result.time = run.time;
  result.mass_history = run.mass_history;
  result.mass_std_history = run.mass_std_history;
  result.has_model_covariance = arm.covariance.has_value();

  const int rejected = run.rows_rejected.sum();
  const int used = run.rows_used.sum();
  if (rejected > 0) {
    result.notes.push_back(
        fmt::format("{} of {} torque rows were left out as outliers", rejected, used + rejected));
  }
  if (run.left_out > 0) {
    result.notes.push_back(fmt::format(
        "{} samples were left out: torque or velocity more than five times the robot's limit", run.left_out));
  }

  const Eigen::MatrixXd before = predict(arm.robot, log, at_motor);
  const validate::Score score_before = score_torque(log, before, options.log.band);
  result.rmse_before = score_before.rmse;
  result.rmse_in_band_before = score_before.rmse_in_band;
  result.band = score_before.band;
  result.rmse_meaning = score_meaning(score_before);
  std::optional<Eigen::MatrixXd> after;
  // A load of which the motion tells only a part must not be passed off as an improvement.
  if (is_answered(run)) {
    after = predict(loaded(arm.robot, run, false), log, at_motor);
    const validate::Score score_after = score_torque(log, *after, score_before.band);
    result.rmse_after = score_after.rmse;
    result.rmse_in_band_after = score_after.rmse_in_band;
    const validate::Score score_friction =
        score_torque(log, predict(loaded(arm.robot, run, true), log, at_motor), score_before.band);
    result.rmse_after_friction = score_friction.rmse;
  }
  if (after && !run.mass.identifiable[0]) {
    result.notes.push_back(
        fmt::format("The joints before joint {} get the load without its mass, which can make them worse.",
                    run.first_joint));
  }
  for (Eigen::Index j = 0; j < before.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "torque error [N·m]";
    spec.series.push_back(
        page::line("without the load", log.time, log.tau.col(j) - before.col(j), page::Hue::kNeutral));
    if (after)
      spec.series.push_back(
          page::line("with the load found", log.time, log.tau.col(j) - after->col(j), page::Hue::kBlue));
    shown_run.residual_plots.push_back(std::move(spec));
  }
  return shown_run;
}

/// Load found where there is none: what the model gets wrong from one recording to the next.
std::vector<ZeroCheck> check_zero(const Arm& arm, const model::Robot& bare,
                                  const std::vector<data::Log>& baselines,
                                  const std::vector<Recording>& zeros, const Options& options) {
  std::vector<ZeroCheck> checks;
  const auto add = [&](const Arm& with, const data::Log& log) {
    const payload::PayloadRun run = estimate(with, log, options, 0.0);
    if (!run.mass.identifiable[0]) {
      note(fmt::format("{}: no use as a zero check: {}", log.path, run.missing));
      return;
    }
    checks.push_back({log.path, run.mass.value[0], run.mass.std[0], run.mass.half_width[0]});
  };
  for (const Recording& zero : zeros) add(arm, zero.causal);
  if (!zeros.empty() || baselines.size() < 2) return checks;
  // Each log by the model of the others.
  for (std::size_t left_out = 0; left_out < baselines.size(); ++left_out) {
    std::vector<data::Log> others;
    for (std::size_t l = 0; l < baselines.size(); ++l) {
      if (l != left_out) others.push_back(baselines[l]);
    }
    add(arm_of(bare, fit(bare, others, options, "zero check")), baselines[left_out]);
  }
  return checks;
}

/// Scatter of the zero checks beyond their own uncertainty [kg].
double excess_of(const std::vector<ZeroCheck>& checks) {
  double sum = 0.0;
  for (const ZeroCheck& check : checks) sum += check.mass * check.mass - check.std * check.std;
  return checks.empty() ? 0.0 : std::sqrt(std::max(0.0, sum / static_cast<double>(checks.size())));
}

std::string describe(const payload::RecursiveFit& fitted, const std::vector<data::Log>& logs) {
  std::string names;
  for (const data::Log& log : logs) names += fmt::format("{}{}", names.empty() ? "" : ", ", log.path);
  return fmt::format(
      "Model: recursive least squares over all joints of {}: {} of the {} combinations of parameters that "
      "any "
      "motion could tell; causal low-pass {:.3g} Hz.",
      names, fitted.determined, fitted.determinable, fitted.residual.cutoff);
}

page::Table residual_table(const statistics::ResidualStatistics& residual) {
  page::Table table({"joint", "residual of the model, filtered [N·m]", "correlated over [s]"});
  for (Eigen::Index j = 0; j < residual.std.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), page::number(residual.std[j]),
                   page::number(residual.correlation_time[j], 2)});
  }
  return table;
}

void run(const Options& options) {
  const Console console{options.output, options.result.json};
  const model::Robot robot = load_robot(options.robot);
  if (options.rows > robot.num_joints()) {
    throw InputError(fmt::format("--rows {}: robot \"{}\" has {} joints; expected 1 to {}", options.rows,
                                 robot.name, robot.num_joints(), robot.num_joints()));
  }

  Arm arm{robot, std::nullopt, std::nullopt};
  std::optional<payload::RecursiveFit> fitted;
  std::vector<data::Log> baselines;
  host::Judgement unloaded;  // what the torque of the logs without load is suspected of
  std::string model_text;
  if (options.baselines.empty()) {
    const model::ModelFile file = model::read_model(options.robot.model);
    arm.residual = residual_of(file);
    arm.covariance = file.covariance;
    if (arm.covariance && !arm.covariance->allFinite()) arm.covariance.reset();
    model_text = fmt::format("Model: {}.", options.robot.model);
  } else {
    for (const std::string& path : options.baselines) {
      Recording baseline = read_recording(path, options.log, robot);
      unloaded.add(baseline.torque);
      baselines.push_back(std::move(baseline.causal));
    }
    fitted = fit(robot, baselines, options, "fitting the arm without load");
    arm = arm_of(robot, *fitted);
    model_text = describe(*fitted, baselines);
  }
  std::vector<Recording> recordings, zeros;
  for (const std::string& path : options.zeros) {
    zeros.push_back(read_recording(path, options.log, robot));
    unloaded.add(zeros.back().torque);
  }
  for (const std::string& path : options.log.logs)
    recordings.push_back(read_recording(path, options.log, robot));

  const std::vector<ZeroCheck> zero_checks = check_zero(arm, robot, baselines, zeros, options);
  const double zero_mass_std = excess_of(zero_checks);

  page::Page page =
      new_page(fmt::format("{}: the load at the flange", robot.name),
               fmt::format("{}, torque of joints {} and up", file_names_of(options.log.logs), options.rows));
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text = model_text + '\n';
  if (fitted) text += residual_table(fitted->residual).to_text(2);
  std::string unanswered;
  bool contradicted = false;
  for (const Recording& recording : recordings) {
    const payload::PayloadRun payload = estimate(arm, recording.causal, options, zero_mass_std);
    Shown shown_run = present(arm, recording, payload, options);
    shown_run.result.judgement.add(unloaded);
    shown_run.result.zero_checks = zero_checks;
    text += '\n' + to_text(shown_run.result);
    if (recordings.size() > 1) page.heading(file_name_of(recording.causal.path));
    add_log_line(page, log_line(recording.causal, payload.cutoff));
    add_to(page, shown_run.result);
    page.plots("Torque error over time", shown_run.residual_plots);
    json.push_back(to_json(shown_run.result));
    const std::string contradiction = payload::contradiction(payload);
    if (!contradiction.empty() && unanswered.empty()) {
      unanswered = fmt::format("{}: {}", recording.causal.path, contradiction);
      contradicted = true;
    }
    if (!is_answered(payload) && unanswered.empty()) {
      unanswered = fmt::format("{}: the load cannot be told: {}", recording.causal.path, payload.missing);
    }
  }
  page.heading("Model of the arm without load");
  page.paragraph(model_text);
  if (fitted) page.table(residual_table(fitted->residual));

  console.print("{}", text);
  // A model that contradicts a log of the arm is none to go on with.
  const std::string output = contradicted ? std::string() : options.output;
  // One log gives the object of the contract, several a list of them.
  finish(console, output, options.result, json.size() == 1 ? json.front() : json, page, [&] {
    keep_residual(fitted->model, fitted->residual);
    model::write_model(output, fitted->model);
  });
  if (!unanswered.empty()) throw NotIdentifiableError(unanswered);
}

}  // namespace

Action set_up_payload(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.add_option("--baseline", options->baselines,
                  "log of the arm without load, to fit the model to; may be given several times")
      .type_name("NOLOAD.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--zero", options->zeros,
                  "log without load that the model was not fitted to: the mass found there is the model's "
                  "error, and widens the "
                  "interval; may be given several times (default with several --baseline: each by the model "
                  "of the others)")
      .type_name("NOLOAD.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--rows", options->rows, "K: use the torques of joints K..N")
      .type_name("K")
      .positive()
      .capture_default_str();
  line.add_option("--true-mass", options->true_mass,
                  "[kg] the load's mass where it is known: shown beside the estimate")
      .type_name("KG")
      .positive();
  add_output_option(line, options->output, "the model that --baseline gives (JSON), for --model next time",
                    false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    if (options->robot.model.empty() == options->baselines.empty()) {
      throw UsageError(
          "the load is what the model of the arm without load does not explain: give either --model "
          "MODEL.json or --baseline NOLOAD.csv, a log to fit it to");
    }
    if (options->baselines.empty() && !options->output.empty()) {
      throw UsageError(
          "--output writes the model that --baseline gives; with --model there is nothing to write");
    }
  });
  line.footer(
      "Logs need torque (tau1..tauN, or currents with --torque-constant). The arm without load is fitted by "
      "recursive\n"
      "least squares over all joints; its errors go into the interval. The interval holds for the torque "
      "scale given:\n"
      "a torque constant that is 2 % off moves the mass by 2 %.\n"
      "With one log --json gives one object, with several a list.\n"
      "Example: heft payload --urdf ur10e --baseline empty.csv --log carrying.csv --report load.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
