#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "diagnosis_result.hpp"
#include "effect_words.hpp"
#include "heft/report/diagnosis.hpp"
#include "page_lines.hpp"
#include "stiffness_parts.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::Table;

/// Of the model written: what it does without has no stiffness there.
std::vector<const Finding*> elastic_findings(const Diagnosis& diagnosis) {
  std::vector<const Finding*> found;
  for (const Finding& finding : diagnosis.findings) {
    if (finding.effect.is<ElasticJoint>() && finding.left_out.empty()) found.push_back(&finding);
  }
  return found;
}

Table joint_table(const Diagnosis& diagnosis) {
  Table table({"joint", "found", "evidence"});
  for (const Finding* finding : elastic_findings(diagnosis)) {
    table.add_row({fmt::format("{}", finding->joint + 1), parameters_in_words(*finding, diagnosis.after),
                   evidence_in_words(*finding)});
  }
  return table;
}

host::Judgement judgement_of(const MotorSideReport& report) {
  host::Judgement judgement = report.diagnosis.judgement();
  judgement.add(report.torque);
  return judgement;
}

}  // namespace

std::string why_none(const Diagnosis& diagnosis) {
  std::vector<std::string> why;
  for (const Finding& finding : diagnosis.findings) {
    if (finding.effect.is<ElasticJoint>() && !finding.left_out.empty())
      why.push_back(fmt::format("joint {}: {}", finding.joint + 1, finding.left_out));
  }
  for (const diagnose::Refusal& refusal : diagnosis.refusals) {
    if (refusal.effect.is<ElasticJoint>())
      why.push_back(fmt::format("joint {}: {}", refusal.joint + 1, refusal.why));
  }
  return fmt::format(
      "the motor's side shows no elastic joint{}{}; expected motion that reaches towards the resonance of a joint "
      "with its load (fast reversals, steps), or link-side encoders (columns qlink1..); record such a log, or measure "
      "deflections under load (--measurements)",
      why.empty() ? "" : ": ", fmt::join(why, "; "));
}

std::string brief(const MotorSideReport& report) {
  std::vector<std::string> known;
  for (const Finding* finding : elastic_findings(report.diagnosis)) {
    const double stiffness = report.stiffness.joints[finding->joint];
    known.push_back(fmt::format("joint {} {}", finding->joint + 1, stiffness_in_words(stiffness, false)));
  }
  return fmt::format("Elastic, as the motor's side shows: {}.", fmt::join(known, ", "));
}

std::string full(const MotorSideReport& report) {
  return fmt::format("{}\n{}\n{}\n{}\n", brief(report), verdict_text(judgement_of(report)),
                     joint_table(report.diagnosis).to_text(2), brief(report.diagnosis));
}

nlohmann::ordered_json to_json(const MotorSideReport& report) {
  nlohmann::ordered_json joints = nlohmann::ordered_json::array();
  for (const Finding* finding : elastic_findings(report.diagnosis)) {
    nlohmann::ordered_json entry{{"joint", finding->joint + 1}, {"p_value", finding->p_value}};
    for (const auto& [name, value] : finding->parameters) entry[name] = value;
    joints.push_back(entry);
  }
  nlohmann::ordered_json json{
      {"source", "motor side"}, {"logs", report.stiffness.sources}, {"joints", joints}};
  put_verdict(json, judgement_of(report));
  return json;
}

model::ModelFile model_file(const MotorSideReport& report) {
  model::ModelFile file = report.stiffness.model_file();
  file.provenance.notes = {brief(report)};
  return file;
}

std::string json(const MotorSideReport& report) { return text_of(to_json(report)); }

page::Page page(const MotorSideReport& report) {
  const Diagnosis& diagnosis = report.diagnosis;
  page::Page page =
      page::new_page("Joint stiffness from the motor's side",
                     fmt::format("{}, {}", diagnosis.after.name, file_names_of(report.stiffness.sources)));
  for (const data::Log& log : report.logs) add_log_line(page, log_line(log));
  page.verdict(brief(report), judgement_of(report));
  page.table(joint_table(diagnosis), "Elastic joints among the effects of a diagnosis");
  page.paragraph(brief(diagnosis));
  page.table(models_table(diagnosis.validate_given, diagnosis.validate_identified, diagnosis.validate_after,
                          diagnosis.after),
             "Errors on the validation logs. " + models_in_words());
  return page;
}

}  // namespace heft::report
