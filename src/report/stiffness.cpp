#include "heft/report/stiffness.hpp"

#include <fmt/format.h>

#include "page_lines.hpp"
#include "stiffness_parts.hpp"
#include "torque_score.hpp"

namespace heft::report {

std::string brief(const stiffness::Stiffness& stiffness) {
  if (stiffness.deflections) return deflection_verdict(stiffness);
  if (stiffness.encoders) return encoder_verdict(stiffness);
  return "stiffnesses as given";
}

model::ModelFile model_file(const stiffness::Stiffness& stiffness) {
  model::ModelFile file = stiffness.model_file();
  file.provenance.notes = {brief(stiffness)};
  if (stiffness.deflections) file.provenance.notes.push_back(stiffness.deflections->diagnosis.verdict);
  return file;
}

std::string why_none(const stiffness::Stiffness& stiffness, const std::string& not_written) {
  if (stiffness.found_any()) return {};
  return fmt::format(
      "no joint's stiffness can be determined from these readings{}: expected intervals with two ends; "
      "measure at more poses, with larger loads, or let joints with gears of one size share a stiffness "
      "(--groups 1-3,4-6)",
      not_written.empty() ? "" : ", nothing was written to " + not_written);
}

std::string full(const StiffnessReport& report) {
  std::string text;
  if (report.stiffness.deflections) text = deflection_text(report.stiffness);
  if (report.stiffness.encoders) text = encoder_text(report.stiffness);
  return text + tool_text(report.tool, report.path);
}

nlohmann::ordered_json to_json(const StiffnessReport& report) {
  nlohmann::ordered_json json;
  if (report.stiffness.deflections) put_deflections(json, report.stiffness);
  else if (report.stiffness.encoders) put_encoders(json, report.stiffness);
  else json = {{"source", "given"}, {"stiffness", numbers(report.stiffness.joints)}};
  put_tool(json, report.tool, report.path);
  return json;
}

std::string json(const StiffnessReport& report) { return text_of(to_json(report)); }
std::string json(const stiffness::MeasurementPlan& plan) { return text_of(to_json(plan)); }

page::Page page(const StiffnessReport& report) {
  const stiffness::Stiffness& stiffness = report.stiffness;
  const std::string& robot = stiffness.robot.name;
  page::Page page = stiffness.encoders
                        ? page::new_page("Joint stiffness from encoders",
                                         fmt::format("{}, {}", robot, file_names_of(stiffness.sources)))
                        : page::new_page("Joint stiffness", robot);
  for (const data::Log& log : report.logs) add_log_line(page, log_line(log));
  if (stiffness.deflections) add_deflections(page, stiffness);
  if (stiffness.encoders) add_encoders(page, stiffness, report.logs);
  add_tool(page, report.tool, report.path);
  return page;
}

}  // namespace heft::report
