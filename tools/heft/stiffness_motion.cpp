/// @file
/// heft stiffness --log: stiffness from the encoders of a log.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "console.hpp"
#include "diagnosis_result.hpp"
#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "page_lines.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"
#include "stiffness_parts.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

using Eigen::VectorXd;
using page::Table;

void from_link_encoders(const StiffnessCommandOptions& options, const model::Robot& robot,
                        const data::LogSet& logs, std::vector<data::Log> read,
                        const host::Judgement& torque) {
  stiffness::EncoderOptions asked;
  asked.rotor_inertia = options.rotor_inertia;
  asked.cutoff = options.log.band;
  report::StiffnessReport answer;
  {
    Progress progress("fitting deflections");
    progress.update(0.0);
    answer.stiffness = stiffness::from_encoders(robot, logs, asked);
  }
  answer.stiffness.judgement.add(torque);
  answer.logs = std::move(read);
  finish_stiffness(options, std::move(answer), {});
}

/// What the motor's side alone shows is the elasticity among the effects of a diagnosis.
void from_motor_side(const StiffnessCommandOptions& options, const model::Robot& robot,
                     const std::vector<data::Log>& logs, const std::vector<data::Log>& validate,
                     const host::Judgement& torque) {
  const Console console{options.result.json, options.model};
  diagnose::Diagnosis diagnosis;
  {
    Progress progress("looking for elastic joints");
    diagnose::DiagnoseOptions asked;
    asked.band = options.log.band;
    asked.joint_sensor = options.log.torque_at == "joint";
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    diagnosis = diagnose::diagnose(robot, logs, validate, asked);
  }
  VectorXd stiffness = VectorXd::Constant(robot.num_joints(), kInfinity);
  nlohmann::ordered_json joints = nlohmann::ordered_json::array();
  Table table({"joint", "found", "evidence"});
  std::vector<std::string> known;
  for (const diagnose::Finding& finding : diagnosis.findings) {
    if (!finding.effect.is<ElasticJoint>()) continue;
    nlohmann::ordered_json entry{{"joint", finding.joint + 1}, {"p_value", finding.p_value}};
    for (const auto& [name, value] : finding.parameters) {
      entry[name] = value;
      if (name == "stiffness") stiffness[finding.joint] = value;
    }
    joints.push_back(entry);
    known.push_back(fmt::format("joint {} {}", finding.joint + 1,
                                report::stiffness_in_words(stiffness[finding.joint], false)));
    table.add_row({fmt::format("{}", finding.joint + 1), parameters_in_words(finding, diagnosis.after),
                   evidence_in_words(finding)});
  }
  if (known.empty()) {
    std::vector<std::string> why;
    for (const diagnose::Refusal& refusal : diagnosis.refusals) {
      if (refusal.effect.is<ElasticJoint>())
        why.push_back(fmt::format("joint {}: {}", refusal.joint + 1, refusal.why));
    }
    throw NotIdentifiableError(
        fmt::format("the motor's side shows no elastic joint{}{}; expected motion that reaches towards the "
                    "resonance of a joint with "
                    "its load (fast reversals, steps), or link-side encoders (columns qlink1..); record such "
                    "a log, or measure "
                    "deflections under load (--measurements)",
                    why.empty() ? "" : ": ", fmt::join(why, "; ")));
  }
  const std::string verdict = fmt::format("Elastic, as the motor's side shows: {}.", fmt::join(known, ", "));
  host::Judgement judgement = diagnosis.judgement();
  judgement.add(torque);
  page::Page page = new_page("Joint stiffness from the motor's side",
                             fmt::format("{}, {}", robot.name, file_names_of(options.log.logs)));
  for (const data::Log& log : logs) add_log_line(page, log_line(log));
  page.verdict(verdict, judgement);
  page.table(table, "Elastic joints among the effects of a diagnosis");
  page.paragraph(report::brief(diagnosis));
  page.table(before_after_table(diagnosis.validate_before, diagnosis.validate_after, robot),
             "Errors on the validation logs, all effects found");
  nlohmann::ordered_json json{{"source", "motor side"}, {"logs", options.log.logs}, {"joints", joints}};
  put_verdict(json, judgement);
  console.print("{}\n{}\n{}\n{}\n", verdict, verdict_text(judgement), table.to_text(2),
                report::brief(diagnosis));
  finish(console, options.model, options.result, json, page, [&] {
    stiffness::Stiffness found = stiffness::given(diagnosis.after, stiffness);
    found.sources = options.log.logs;
    model::ModelFile file = found.model_file();
    file.provenance.notes = {verdict};
    model::write_model(options.model, file);
  });
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
  data::LogFiles files;
  files.train = options.log.logs;
  files.judge = options.validate;
  files.split = 0.0;
  files.torque_constant = options.log.torque_constant;
  files.torque_at = options.log.torque_at == "joint" ? data::TorqueAt::kJoint : data::TorqueAt::kMotor;
  files.robot = robot.name;
  const data::LogSet opened = data::open_logs(robot.joint_specs(), files);
  for (const std::string& line : opened.notes()) note(line);
  host::Judgement torque;
  std::vector<data::Log> logs = read_all(opened.train(), options, robot, torque);
  if (stiffness::has_link_encoders(opened.train().front()))
    return from_link_encoders(options, robot, opened, std::move(logs), torque);
  if (options.validate.empty()) {
    throw UsageError(
        "the log has no link-side encoders (columns qlink1..); from the motor's side alone an elastic joint "
        "is taken only when a log that the fit has not seen confirms it: give one with --validate LOG.csv");
  }
  const std::vector<data::Log> validate = read_all(opened.judge(), options, robot, torque);
  from_motor_side(options, robot, logs, validate, torque);
}

}  // namespace heft::tools
