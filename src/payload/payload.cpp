#include "heft/payload/payload.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/core/physical_body.hpp"
#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/point_load.hpp"
#include "heft/validate/judgement.hpp"
#include "heft/validate/predict.hpp"
#include "judgement.hpp"
#include "runs.hpp"

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
    JointActuation<double>& actuation = result.joints[i].actuation;
    if (run.coulomb_change[i].identifiable) actuation.coulomb_friction += run.coulomb_change[i].value;
    if (run.viscous_change[i].identifiable) actuation.viscous_friction += run.viscous_change[i].value;
  }
  return result;
}

/// Torque errors without the load and with it.
void compare_torque(const model::Robot& arm, const data::MotionLog& read, const Options& options,
                    Payload& result) {
  const data::Log& log = read.log;
  const validate::MotionRows rows = validate::rows_of(arm, log, read.motion);
  const auto predicted = [&](const model::Robot& robot) {
    return validate::Predictor(robot, log.time[0]).rows(rows);
  };
  const Eigen::MatrixXd before = predicted(arm);
  result.before = validate::score(log, before, options.cutoff);
  result.time = log.time;
  result.error_before = log.tau - before;
  if (!result.answered()) return;
  const double band = result.before.band;
  const Eigen::MatrixXd after = predicted(loaded(arm, result.run, false));
  // The load is in true units, the torque as the drives measure it.
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(log.tau.cols());
  for (std::size_t j = 0; j < result.drive_scale.size(); ++j)
    scale[static_cast<Eigen::Index>(j)] = result.drive_scale[j].value;
  const Eigen::MatrixXd with_load = before + (after - before) * scale.asDiagonal();
  result.error_after = log.tau - with_load;
  result.after = validate::score(log, with_load, band);
  const Eigen::MatrixXd friction = predicted(loaded(arm, result.run, true)) - after;
  result.after_friction = validate::score(log, with_load + friction, band);
}

/// The log row by row through LiveLoad.
std::vector<LiveEvent> events_of(const UnloadedArm& arm, const data::Log& log, const Options& options) {
  LiveLoad live(arm, options);
  std::vector<LiveEvent> events;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    data::LiveRow row{log.time[k], log.q.row(k), {}, log.tau.row(k)};
    if (log.qd.cols() > 0) row.qd = log.qd.row(k);
    if (std::optional<LiveEvent> event = live.push(row)) events.push_back(std::move(*event));
  }
  return events;
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
  if (result.after && !run.mass.identifiable) {
    result.notes.push_back(
        fmt::format("The joints before joint {} get the load without its mass, which can make them worse.",
                    run.first_joint));
  }
}

}  // namespace

model::Robot as_measured(const UnloadedArm& arm, const Options& options) {
  return model::as_measured(arm.robot, options.torque_at == data::TorqueAt::kJoint,
                            arm.record ? &*arm.record : nullptr);
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
  run.drive_scale = arm.drive_scale;
  if (options.progress) {
    run.progress = [&options, path = log.path](double done) { options.progress(path, done); };
  }
  return run;
}

bool Payload::answered() const {
  return run.mass.identifiable ||
         (!run.mass_visible && std::all_of(run.first_moment.begin(), run.first_moment.end(),
                                           [](const Estimated& moment) { return moment.identifiable; }));
}

std::string Payload::unanswered() const {
  if (!contradiction.empty()) return fmt::format("{}: {}", log, contradiction);
  return answered() ? "" : fmt::format("{}: the load cannot be determined: {}", log, run.missing);
}

bool Payload::has_inertia() const {
  const auto all = [](const std::vector<Estimated>& values) {
    return std::all_of(values.begin(), values.end(), [](const Estimated& e) { return e.identifiable; });
  };
  if (!run.mass.identifiable || !all(run.first_moment) || !all(run.inertia) || run.parameters.size() != 10)
    return false;
  InertialParameters<double> found;
  std::copy(run.parameters.begin(), run.parameters.end(), found.begin());
  return check_physical(found) == Status::kOk;
}

InertialParameters<double> Payload::body() const {
  if (const std::string why = unanswered(); !why.empty()) throw NotIdentifiableError(why);
  if (!run.mass.identifiable || !(run.mass.lower > 0.0)) {
    throw NotIdentifiableError(
        fmt::format("{}: no load is clear of zero ({:.3g} ± {:.2g} kg); there is nothing to write", log,
                    run.mass.value, run.mass.half_width()));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    if (run.com[k].identifiable) continue;
    throw NotIdentifiableError(fmt::format(
        "{}: the centre of mass along {} is not known, which a controller needs; record a motion that tilts the load that "
        "way against gravity",
        log, "xyz"[k]));
  }
  if (!has_inertia())
    return model::point_body(run.mass.value, {run.com[0].value, run.com[1].value, run.com[2].value});
  InertialParameters<double> found;
  std::copy(run.parameters.begin(), run.parameters.end(), found.begin());
  return found;
}

const LiveEvent* Payload::first_stated() const {
  const auto first = std::find_if(
      live.begin(), live.end(), [](const LiveEvent& event) { return event.kind == LiveEvent::Kind::kKnown; });
  return first == live.end() ? nullptr : &*first;
}

Payload estimate(const UnloadedArm& arm, const data::LogSource& source, const Options& options) {
  refuse_unloaded(arm, source);
  Payload result;
  const data::MotionLog read = data::read_motion(source, true, &result.log_notes);
  data::Log log = read.log;
  // The estimator sees what was measured; what was derived with zero phase is for the errors, in hindsight.
  if (read.motion.velocity_derived) log.qd.resize(0, 0);
  const model::Robot unloaded = as_measured(arm, options);
  result.robot = arm.robot.name;
  result.log = source.path;
  result.frame = frame_name(arm.robot);
  const Eigen::Index rows = log.time.size();
  result.log_seconds = rows > 1 ? log.time[rows - 1] - log.time[0] : 0.0;
  result.log_rate = result.log_seconds > 0.0 ? static_cast<double>(rows - 1) / result.log_seconds : 0.0;
  result.run = run_payload(unloaded, log, run_options(arm, log, options, arm.zero_mass_std()));
  if (result.run.mass_visible) result.live = events_of(arm, log, options);
  result.has_model_covariance = arm.covariance.has_value();
  result.zero_checks = arm.zero_checks;
  result.drive_scale = arm.drive_scale;
  result.contradiction = contradiction(result.run);
  result.judgement = judge(result.run);
  if (options.true_mass > 0) result.true_mass = options.true_mass;
  compare_torque(unloaded, read, options, result);
  const Estimated& mass = result.run.mass;
  if (result.true_mass && mass.identifiable) {
    result.judgement.add(
        validate::judge_against_truth("the mass", mass.value, mass.half_width(), *result.true_mass));
  }
  add_notes(result);
  return result;
}

}  // namespace heft::payload
