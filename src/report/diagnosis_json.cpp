#include "diagnosis_result.hpp"
#include "host/json.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

nlohmann::ordered_json joint_or_null(int joint) {
  return joint < 0 ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(joint + 1);
}

nlohmann::ordered_json before_after_json(const validate::Score& before, const validate::Score& identified,
                                         const validate::Score& after) {
  nlohmann::ordered_json json;
  json["rmse_before"] = host::json_array(before.rmse);
  json["rmse_identified"] = host::json_array(identified.rmse);
  json["rmse_after"] = host::json_array(after.rmse);
  json["rmse_in_band_before"] = host::json_array(before.rmse_in_band);
  json["rmse_in_band_identified"] = host::json_array(identified.rmse_in_band);
  json["rmse_in_band_after"] = host::json_array(after.rmse_in_band);
  json["r2_before"] = host::json_array(before.r2);
  json["r2_after"] = host::json_array(after.r2);
  json["rmse_percent_of_max_before"] = host::json_array(before.percent_of_max);
  json["rmse_percent_of_max_after"] = host::json_array(after.percent_of_max);
  json["samples"] = after.samples;
  return json;
}

/// R² in band: 1 - mean square of the error / variance of the torque, all samples.
Eigen::VectorXd r2_in_band(const validate::Score& score, const validate::Score& torque) {
  const Eigen::VectorXd variance = torque.rmse_in_band.cwiseAbs2() - torque.bias.cwiseAbs2();
  return (1.0 - score.rmse_in_band.array().square() / variance.array()).matrix();
}

nlohmann::ordered_json rivals_json(const std::vector<diagnose::Rival>& rivals, bool with_score) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const diagnose::Rival& rival : rivals) {
    nlohmann::ordered_json entry{{"kind", rival.effect.id()}, {"joint", joint_or_null(rival.joint)}};
    if (with_score) entry["delta_bic"] = host::number_or_null(rival.delta_bic);
    entry["parameters"] = nlohmann::ordered_json::object();
    for (const auto& [name, value] : rival.parameters)
      entry["parameters"][name] = host::number_or_null(value);
    if (rival.driven_joint >= 0) entry["driven_joint"] = rival.driven_joint + 1;
    json.push_back(std::move(entry));
  }
  return json;
}

/// Components of one vector become one entry.
void join_vector(nlohmann::ordered_json& json) {
  if (!json.contains("com_x") || !json.contains("com_y") || !json.contains("com_z")) return;
  json["com"] = {json["com_x"], json["com_y"], json["com_z"]};
  for (const char* part : {"com_x", "com_y", "com_z"}) json.erase(part);
}

nlohmann::ordered_json half_widths_json(const Finding& finding) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t k = 0; k < finding.half_widths.size(); ++k)
    json[finding.parameters[k].first] = host::number_or_null(finding.half_widths[k]);
  join_vector(json);
  return json;
}

nlohmann::ordered_json parameters_json(const Finding& finding) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const auto& [name, value] : finding.parameters) json[name] = host::number_or_null(value);
  join_vector(json);
  for (const auto& [name, value] : finding.words) json[name] = value;
  if (!finding.events.empty()) {
    json["events"] = nlohmann::ordered_json::array();
    for (std::size_t k = 0; k < finding.events.size(); ++k) {
      nlohmann::ordered_json event{{"t0", finding.events[k].first}, {"duration", finding.events[k].second}};
      if (k < finding.event_logs.size()) event["log"] = finding.event_logs[k];
      if (k < finding.forces.size()) event["force"] = host::json_array(finding.forces[k]);
      json["events"].push_back(std::move(event));
    }
  }
  return json;
}

nlohmann::ordered_json effect_json(const Finding& finding, const model::Robot& robot) {
  nlohmann::ordered_json json{{"kind", finding.effect.id()},
                              {"joint", joint_or_null(finding.joint)},
                              {"name", effect_name(finding.effect)},
                              {"parameters", parameters_json(finding)},
                              {"half_width_95", half_widths_json(finding)},
                              {"p_value", host::number_or_null(finding.p_value)},
                              {"delta_bic", host::number_or_null(finding.delta_bic)},
                              {"cross_validated_fall", host::number_or_null(finding.cross_validated)},
                              {"main_joint", finding.main_joint + 1},
                              {"validate_rmse_before", host::number_or_null(finding.validate_before)},
                              {"validate_rmse_after", host::number_or_null(finding.validate_after)},
                              {"rivals", rivals_json(finding.rivals, true)},
                              {"equivalent", rivals_json(finding.equivalent, false)},
                              {"shown_by", shown_by(finding)},
                              {"stable", finding.stable ? nlohmann::ordered_json(*finding.stable) : nullptr},
                              {"in_model", finding.left_out.empty()}};
  if (!finding.left_out.empty()) json["left_out"] = finding.left_out;
  if (finding.seen) {
    const auto pair = [](const double(&range)[2]) { return nlohmann::ordered_json{range[0], range[1]}; };
    json["range"] = {{"velocity", pair(finding.seen->velocity)},
                     {"load", pair(finding.seen->load)},
                     {"position", pair(finding.seen->position)}};
    if (finding.seen->temperature) json["range"]["temperature"] = *finding.seen->temperature;
  }
  const plausibility::GearCheck gear = gear_check(finding, robot);
  using Outcome = plausibility::GearCheck::Outcome;
  json["torque_rms"] = host::number_or_null(finding.torque_rms);
  json["torque_peak"] = host::number_or_null(finding.torque_peak);
  json["torque_joint"] = joint_or_null(finding.torque_joint);
  json["share_of_error"] = host::number_or_null(finding.share_of_error());
  json["plausible"] = gear.outcome == Outcome::kUnknown
                          ? nlohmann::ordered_json(nullptr)
                          : nlohmann::ordered_json(gear.outcome == Outcome::kPlausible);
  json["plausibility"] = gear.words;
  if (finding.driven_joint >= 0) json["driven_joint"] = finding.driven_joint + 1;
  if (finding.displacement != Displacement::kPosition)
    json["displacement"] = displacement_name(finding.displacement);
  return json;
}

}  // namespace

nlohmann::ordered_json diagnosis_json(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  nlohmann::ordered_json json;
  json["robot"] = diagnosis.after.name;
  put_verdict(json, judgement_of(diagnosis, context));
  json["summary"] = brief(diagnosis);
  json["not_explained"] = nlohmann::ordered_json::array();
  for (const diagnose::NotExplained& joint : diagnosis.not_explained) {
    json["not_explained"].push_back({{"joint", joint.joint + 1},
                                     {"error", joint.error},
                                     {"error_alone", joint.alone},
                                     {"share_of_torque", joint.share},
                                     {"share_of_max", joint.share_of_largest},
                                     {"contradicts_other_joints", joint.contradicts}});
  }
  json["torque_at"] = context.torque_at;
  const double band = diagnosis.validate_after.band;
  json["band_hz"] = band > 0.0 ? nlohmann::ordered_json(band) : nlohmann::ordered_json(nullptr);
  json["cutoff_hz"] = diagnosis.cutoff;
  if (diagnosis.joint_cutoffs.size() > 0)
    json["joint_cutoffs_hz"] = host::json_array(diagnosis.joint_cutoffs);
  json["train"] =
      before_after_json(diagnosis.train_before, diagnosis.train_identified, diagnosis.train_after);
  json["validate"] =
      before_after_json(diagnosis.validate_before, diagnosis.validate_identified, diagnosis.validate_after);
  if (diagnosis.validate_torque.rmse_in_band.size() > 0) {
    const RelativeErrors relative = relative_errors(diagnosis);
    nlohmann::ordered_json& validate = json["validate"];
    validate["r2_in_band_before"] =
        host::json_array(r2_in_band(diagnosis.validate_before, diagnosis.validate_torque));
    validate["r2_in_band_after"] =
        host::json_array(r2_in_band(diagnosis.validate_after, diagnosis.validate_torque));
    validate["relative_error_in_band_before"] = host::number_or_null(relative.before);
    validate["relative_error_in_band_after"] = host::number_or_null(relative.after);
    validate["relative_error_in_band_moving_before"] = host::number_or_null(relative.moving_before);
    validate["relative_error_in_band_moving_after"] = host::number_or_null(relative.moving_after);
  }
  json["effects"] = nlohmann::ordered_json::array();
  for (const Finding& finding : diagnosis.findings)
    json["effects"].push_back(effect_json(finding, diagnosis.after));
  json["unexplained"] = nlohmann::ordered_json::array();
  for (const diagnose::Unexplained& u : diagnosis.unexplained) {
    nlohmann::ordered_json evidence = nlohmann::ordered_json::object();
    for (const auto& [name, value] : u.evidence) evidence[name] = host::number_or_null(value);
    json["unexplained"].push_back({{"joint", joint_or_null(u.joint)},
                                   {"what", u.what},
                                   {"evidence", std::move(evidence)},
                                   {"cause", diagnose::to_string(u.cause)}});
  }
  json["joints"] = ceilings_json(diagnosis);
  json["refused"] = nlohmann::ordered_json::array();
  for (const diagnose::Refusal& refusal : strongest(diagnosis)) {
    json["refused"].push_back({{"kind", refusal.effect.id()},
                               {"joint", joint_or_null(refusal.joint)},
                               {"why", refusal.why},
                               {"gain", host::number_or_null(refusal.gain)}});
  }
  json["validate_logs"] = nlohmann::ordered_json::array();
  for (std::size_t k = 0;
       k < std::min({diagnosis.validate_each_before.size(), diagnosis.validate_each_identified.size(),
                     diagnosis.validate_each_after.size()});
       ++k) {
    nlohmann::ordered_json entry{{"log", diagnosis.validate_each_after[k].log}};
    entry.update(before_after_json(diagnosis.validate_each_before[k], diagnosis.validate_each_identified[k],
                                   diagnosis.validate_each_after[k]));
    json["validate_logs"].push_back(std::move(entry));
  }
  json["refit"] = nullptr;
  if (const auto& refitted = diagnosis.refitted)
    json["refit"] = {{"part", refitted->part}, {"error_ratio", refitted->ratio}};
  json["other_load"] = nullptr;
  if (const auto& load = diagnosis.other_load)
    json["other_load"] = {{"mass", load->mass}, {"half_width", load->half_width}};
  json["errors_that_rise"] = errors_that_rise(diagnosis);
  json["candidates_tried"] = diagnosis.candidates;
  json["train_seconds"] = diagnosis.seconds;
  json["notes"] = diagnosis.notes;
  json["logs"] = {{"train", context.train}, {"validate", context.validate}};
  json["command"] = context.command;
  return json;
}

std::string json(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  return diagnosis_json(diagnosis, context)
      .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace heft::report
