#include "heft/payload/payload.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "beyond_regressor.hpp"
#include "causal_signals.hpp"
#include "heft/host/error.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/payload/judgement.hpp"
#include "heft/validate/judgement.hpp"
#include "payload_log.hpp"

namespace heft::payload {
namespace {

/// No sample of a log without load may be weighed: the model fits it, or the interval was made from it.
void refuse_unloaded(const UnloadedArm& arm, const data::LogSource& log) {
  for (const auto* sources : {&arm.logs, &arm.zeros}) {
    for (const data::LogSource& unloaded : *sources) {
      const std::string shared = data::shared_samples(log, unloaded);
      if (shared.empty()) continue;
      throw DataError(
          fmt::format("{}: {}, which is a log without load: expected another recording; give each log once",
                      log.path, shared));
    }
  }
}

std::string frame_name(const model::Robot& robot) {
  const bool at_link = robot.tip_link == robot.joints.back().link_name;
  return at_link ? fmt::format("the frame of the last link, {}", robot.tip_link)
                 : fmt::format("the frame of {}", robot.tip_link);
}

/// The robot with the load found at its last link, and with the friction as found.
model::Robot loaded(const model::Robot& robot, const PayloadRun& run, bool with_friction) {
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

/// Torque that a model expects along a log. The sign of friction goes through zero within the width that the estimator
/// uses, so that a joint at rest with a noisy velocity has none.
Eigen::MatrixXd predict(const model::Robot& robot, const PayloadLog& log, bool at_joint) {
  const double width = log.causal.qd.cols() > 0 ? kMeasuredSignWidth : kDerivedSignWidth;
  model::MotionTorque motion(as_measured(robot, at_joint));
  const data::Log& rows = log.derived;
  const Eigen::VectorXd time = rows.time.array() - rows.time[0];
  motion.start_from(time, rows.q, rows.qd, rows.qdd, rows.tau, width);
  return motion.torque(time, rows.q, rows.qd, rows.qdd, width);
}

/// Torque errors without the load and with it.
void compare_torque(const UnloadedArm& arm, const PayloadLog& log, const Options& options, Payload& result) {
  const bool at_joint = options.torque_at == data::TorqueAt::kJoint;
  const Eigen::MatrixXd before = predict(arm.robot, log, at_joint);
  result.before = validate::score(log.derived, before, options.cutoff);
  result.time = log.derived.time;
  result.error_before = log.derived.tau - before;
  if (!result.answered()) return;
  const double band = result.before.band;
  const Eigen::MatrixXd after = predict(loaded(arm.robot, result.run, false), log, at_joint);
  result.error_after = log.derived.tau - after;
  result.after = validate::score(log.derived, after, band);
  result.after_friction =
      validate::score(log.derived, predict(loaded(arm.robot, result.run, true), log, at_joint), band);
}

void add_notes(Payload& result) {
  const PayloadRun& run = result.run;
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
  if (result.after && !run.mass.identifiable[0]) {
    result.notes.push_back(
        fmt::format("The joints before joint {} get the load without its mass, which can make them worse.",
                    run.first_joint));
  }
}

}  // namespace

PayloadLog read_payload_log(const data::LogSource& source, std::vector<std::string>* notes) {
  data::MotionLog read = data::read_motion(source, true, notes);
  PayloadLog log{read.log, std::move(read.log)};
  if (read.motion.velocity_derived) log.causal.qd.resize(0, 0);
  return log;
}

PayloadRunOptions run_options(const UnloadedArm& arm, const data::Log& log, const Options& options,
                              double zero_mass_std) {
  PayloadRunOptions run;
  run.first_joint = options.first_joint;
  run.cutoff = options.cutoff;
  run.torque_at_joint = options.torque_at == data::TorqueAt::kJoint;
  run.residual = arm.residual;
  run.model_covariance = arm.covariance;
  run.zero_mass_std = zero_mass_std;
  if (options.progress) {
    run.progress = [&options, path = log.path](double done) { options.progress(path, done); };
  }
  return run;
}

bool Payload::answered() const {
  const auto& known = run.first_moment.identifiable;
  return run.mass.identifiable[0] ||
         (!run.mass_visible && std::all_of(known.begin(), known.end(), [](bool is) { return is; }));
}

std::string Payload::unanswered() const {
  if (!contradiction.empty()) return fmt::format("{}: {}", log, contradiction);
  return answered() ? "" : fmt::format("{}: the load cannot be determined: {}", log, run.missing);
}

Payload estimate(const UnloadedArm& arm, const data::LogSource& source, const Options& options) {
  refuse_unloaded(arm, source);
  Payload result;
  const PayloadLog log = read_payload_log(source, &result.log_notes);
  result.robot = arm.robot.name;
  result.log = source.path;
  result.frame = frame_name(arm.robot);
  const Eigen::Index rows = log.causal.time.size();
  result.log_seconds = rows > 1 ? log.causal.time[rows - 1] - log.causal.time[0] : 0.0;
  result.log_rate = result.log_seconds > 0.0 ? static_cast<double>(rows - 1) / result.log_seconds : 0.0;
  result.run = run_payload(arm.robot, log.causal, run_options(arm, log.causal, options, arm.zero_mass_std()));
  result.has_model_covariance = arm.covariance.has_value();
  result.zero_checks = arm.zero_checks;
  result.contradiction = contradiction(result.run);
  result.judgement = judge(result.run);
  if (options.true_mass > 0) result.true_mass = options.true_mass;
  compare_torque(arm, log, options, result);
  if (result.true_mass && result.run.mass.identifiable[0]) {
    result.judgement.add(validate::judge_against_truth("the mass", result.run.mass.value[0],
                                                       result.run.mass.half_width[0], *result.true_mass));
  }
  add_notes(result);
  return result;
}

}  // namespace heft::payload
