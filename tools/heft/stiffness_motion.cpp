/// @file
/// heft stiffness --log: stiffness from the encoders of a log.
#include <utility>
#include <vector>

#include "console.hpp"
#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/error.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {
namespace {

void from_link_encoders(const StiffnessCommandOptions& options, const model::Robot& robot,
                        const data::LogSet& logs, std::vector<data::Log> read,
                        const host::Judgement& torque) {
  stiffness::EncoderOptions asked;
  asked.rotor_inertia = options.rotor_inertia;
  asked.cutoff = options.log.band;
  asked.torque = torque;
  report::StiffnessReport answer;
  answer.logs = std::move(read);
  {
    Progress progress("fitting deflections");
    progress.update(0.0);
    answer.stiffness = stiffness::from_encoders(robot, logs, asked);
  }
  finish_stiffness(options, robot, std::move(answer));
}

/// What the motor's side alone shows is the elasticity among the effects of a diagnosis.
void from_motor_side(const StiffnessCommandOptions& options, const model::Robot& robot,
                     const data::LogSet& opened, std::vector<data::Log> logs, const host::Judgement& torque) {
  const Console console{options.result.json, options.model};
  report::MotorSideReport answer;
  answer.torque = torque;
  answer.logs = std::move(logs);
  {
    Progress progress("looking for elastic joints");
    diagnose::DiagnoseOptions asked;
    asked.band = options.log.band;
    asked.refit = false;  // stiffnesses are those of the training logs
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    answer.diagnosis = diagnose::diagnose(robot, opened, asked);
  }
  answer.stiffness = stiffness::given(answer.diagnosis.after);
  answer.stiffness.sources = options.log.logs;
  if (!answer.stiffness.found_any()) throw NotIdentifiableError(report::why_none(answer.diagnosis));
  console.print("{}", report::full(answer));
  finish(console, options.model, options.result, report::json(answer), report::page(answer),
         [&] { model::write_model(options.model, report::model_file(answer)); });
}

/// @param torque  gets what the torque is suspected of
std::vector<data::Log> read_all(const std::vector<data::LogSource>& sources,
                                const StiffnessCommandOptions& options, const model::Robot& robot,
                                host::Judgement& torque) {
  std::vector<data::Log> logs;
  for (const data::LogSource& source : sources) {
    logs.push_back(data::read(source));
    torque.add(judge_torque(logs.back(), robot, options.log, options.log.measured_at()));
  }
  return logs;
}

}  // namespace

void stiffness_from_motion(const StiffnessCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  data::LogFiles files = files_of(options.log, robot, options.validate);
  files.split = 0.0;
  files.cutoff = 0.0;  // --band goes to the fit of the deflections, or to the errors of the diagnosis
  const data::LogSet opened = open_logs(robot, files);
  host::Judgement torque;
  std::vector<data::Log> logs = read_all(opened.train(), options, robot, torque);
  if (!stiffness::link_encoder_joints(logs.front()).empty())
    return from_link_encoders(options, robot, opened, std::move(logs), torque);
  if (options.validate.empty()) {
    throw UsageError(
        "the log has no link-side encoders (columns qlink1..); from the motor's side alone an elastic joint "
        "is taken only when a log that the fit has not seen confirms it: give one with --validate LOG.csv");
  }
  (void)read_all(opened.judge(), options, robot, torque);
  from_motor_side(options, robot, opened, std::move(logs), torque);
}

}  // namespace heft::tools
