/// @file
/// heft stiffness --log: stiffness from the encoders of a log.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "console.hpp"
#include "diagnosis_result.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/error.hpp"
#include "heft/stiffness/joint_encoders.hpp"
#include "heft/stiffness/judgement.hpp"
#include "page_lines.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using page::Table;
using stiffness::JointEncoderFit;
using stiffness::JointStiffness;
using stiffness::Uncertain;

nlohmann::ordered_json to_json(const Uncertain& u) {
  return {{"value", u.value}, {"std", u.std}, {"lower", u.lower}, {"upper", u.upper}};
}

/// A loop's width in µrad with its deviation.
std::string microradians(const Uncertain& u) {
  return fmt::format("{} ± {}", page::number(1e6 * u.value, 3), page::number(1e6 * u.std, 2));
}

std::vector<std::string> row_of(const std::string& log, const JointStiffness& joint) {
  return {fmt::format("{}", joint.joint + 1),
          log,
          joint.identifiable ? stiffness_in_words(joint.stiffness, false) : "–",
          stiffness_interval_in_words(joint.stiffness_lower, joint.stiffness_upper, false),
          microradians(joint.direction.loop),
          joint.time_shift_known ? page::number(1e3 * joint.time_shift.value, 3) : "–",
          page::number(1e6 * joint.rms_rigid, 3),
          page::number(1e6 * joint.rms, 3)};
}

Table joint_table(const JointEncoderFit& fit, const std::vector<std::string>& logs) {
  Table table({"joint", "log", "stiffness", "95 % interval", "loop over direction [µrad]",
               "link late by [ms]", "left without torque [µrad]", "and with it [µrad]"});
  for (std::size_t j = 0; j < fit.joints.size(); ++j) {
    for (std::size_t log = 0; log < fit.separate.size() && fit.separate.size() > 1; ++log) {
      table.add_row(row_of(file_name_of(logs[log]), fit.separate[log][j]));
    }
    table.add_row(row_of(fit.separate.size() > 1 ? "all" : file_name_of(logs.front()), fit.pooled[j]));
  }
  return table;
}

nlohmann::ordered_json joint_json(const JointStiffness& joint) {
  nlohmann::ordered_json json{{"joint", joint.joint + 1},
                              {"identifiable", joint.identifiable},
                              {"missing", joint.reason},
                              {"stiffness", joint.stiffness},
                              {"stiffness_std", joint.stiffness_std},
                              {"stiffness_low", joint.stiffness_lower},
                              {"stiffness_high", joint.stiffness_upper},
                              {"compliance", to_json(joint.compliance)},
                              {"time_shift", to_json(joint.time_shift)},
                              {"hysteresis",
                               {{"loop", to_json(joint.direction.loop)},
                                {"lost_motion_if_no_friction", joint.direction.lost_motion_if_no_friction},
                                {"friction_if_no_lost_motion", joint.direction.friction_if_no_lost_motion},
                                {"lost_motion_at_least", joint.direction.lost_motion_at_least},
                                {"lost_motion_at_most", joint.direction.lost_motion_at_most},
                                {"reading", joint.direction.text}}},
                              {"r2", joint.r2},
                              {"rms_rigid", joint.rms_rigid},
                              {"rms", joint.rms},
                              {"samples", joint.samples},
                              {"torque_range", joint.torque_range}};
  json["gear_hysteresis"] =
      joint.gear_hysteresis ? to_json(*joint.gear_hysteresis) : nlohmann::ordered_json(nullptr);
  json["terms"] = nlohmann::ordered_json::array();
  for (const stiffness::DeflectionTerm term : joint.terms)
    json["terms"].push_back(stiffness::to_string(term));
  json["evidence"] = nlohmann::ordered_json::array();
  for (const stiffness::TermEvidence& term : joint.evidence) {
    json["evidence"].push_back({{"term", stiffness::to_string(term.term)},
                                {"used", term.used},
                                {"rms_without", term.rms_without},
                                {"rms_with", term.rms_with},
                                {"p_value", term.p_value},
                                {"verdict", term.verdict}});
  }
  json["notes"] = joint.notes;
  return json;
}

/// Velocity of a joint as logged, or by differences.
VectorXd velocity_of(const data::Log& log, int joint) {
  if (log.qd.cols() > 0) return log.qd.col(joint);
  VectorXd velocity = VectorXd::Zero(log.time.size());
  for (Index i = 1; i + 1 < velocity.size(); ++i) {
    velocity[i] = (log.q(i + 1, joint) - log.q(i - 1, joint)) / (log.time[i + 1] - log.time[i - 1]);
  }
  return velocity;
}

/// Deflection over torque, one plot a joint: the loop, and the spring that was found. What the link's channel comes late
/// by is taken off: it is larger than the spring, and goes with velocity.
std::vector<page::PlotSpec> loop_plots(const std::vector<data::Log>& logs, const JointEncoderFit& fit) {
  std::vector<page::PlotSpec> specs;
  for (std::size_t k = 0; k < fit.joints.size(); ++k) {
    const int j = fit.joints[k];
    page::PlotSpec spec;
    spec.title = fmt::format("joint {}", j + 1);
    spec.x_label = "torque [kN·m]";
    spec.y_label = "motor minus link [mrad]";
    spec.width = 300;
    spec.height = 260;
    double low = std::numeric_limits<double>::infinity(), high = -low, sum = 0.0;
    for (const data::Log& log : logs) {
      const auto column = std::find_if(log.extra.begin(), log.extra.end(), [&](const auto& e) {
        return e.first == fmt::format("qlink{}", j + 1);
      });
      if (column == log.extra.end()) continue;
      const double late = fit.pooled[k].time_shift_known ? fit.pooled[k].time_shift.value : 0.0;
      const VectorXd phi = 1e3 * (log.q.col(j) - column->second - late * velocity_of(log, j));
      const VectorXd tau = 1e-3 * log.tau.col(j);
      sum += tau.mean();
      low = std::min(low, tau.minCoeff());
      high = std::max(high, tau.maxCoeff());
      spec.series.push_back(page::line(file_name_of(log.path), tau, VectorXd(phi.array() - phi.mean())));
    }
    if (fit.pooled[k].identifiable) {
      const double c = 1e6 * fit.pooled[k].compliance.value, middle = sum / static_cast<double>(logs.size());
      page::Series spring{"the spring found", {low, high}, {c * (low - middle), c * (high - middle)}};
      spring.style = page::Style::kDashed;
      spring.hue = page::Hue::kNeutral;
      spec.series.push_back(spring);
    }
    specs.push_back(spec);
  }
  return specs;
}

void from_link_encoders(const StiffnessCommandOptions& options, const LoadedRobot& loaded,
                        const std::vector<data::Log>& logs, const host::Judgement& torque) {
  const Console console{options.result.json, options.model};
  const model::Robot& robot = loaded.robot;
  stiffness::JointEncoderOptions asked;
  if (!options.rotor_inertia.empty() &&
      static_cast<int>(options.rotor_inertia.size()) != robot.num_joints()) {
    throw InputError(
        fmt::format("--rotor-inertia: found {} values, robot '{}' has {} joints; expected one a joint",
                    options.rotor_inertia.size(), robot.name, robot.num_joints()));
  }
  asked.rotor_inertia = options.rotor_inertia;
  for (const model::RobotJoint& joint : robot.joints) {
    if (options.rotor_inertia.empty()) asked.rotor_inertia.push_back(joint.actuation.rotor_inertia);
    asked.coulomb_friction.push_back(joint.actuation.coulomb_friction);
  }
  const bool rotors_known =
      std::any_of(asked.rotor_inertia.begin(), asked.rotor_inertia.end(), [](double J) { return J != 0.0; });
  if (std::all_of(asked.coulomb_friction.begin(), asked.coulomb_friction.end(),
                  [](double f) { return f == 0.0; })) {
    asked.coulomb_friction.clear();
  }
  JointEncoderFit fit;
  {
    Progress progress("fitting deflections");
    progress.update(0.0);
    fit = stiffness::fit_joint_encoders(logs, asked);
  }
  VectorXd stiffness = VectorXd::Constant(robot.num_joints(), std::numeric_limits<double>::infinity());
  std::vector<std::string> known, missing;
  for (const JointStiffness& joint : fit.pooled) {
    if (joint.identifiable) {
      stiffness[joint.joint] = joint.stiffness;
      known.push_back(
          fmt::format("joint {} {}", joint.joint + 1, stiffness_in_words(joint.stiffness, false)));
    } else {
      missing.push_back(fmt::format("joint {}: {}", joint.joint + 1, joint.reason));
    }
  }
  if (known.empty()) {
    throw NotIdentifiableError(
        fmt::format("no stiffness can be told from these logs; {}", fmt::join(missing, "; ")));
  }
  const std::string verdict = fmt::format("Stiffness of the gears: {}.", fmt::join(known, ", "));
  host::Judgement judgement = stiffness::judge(fit, rotors_known);
  judgement.add(torque);
  std::string text = verdict + "\n" + verdict_text(judgement);
  for (const std::string& line : missing) text += fmt::format("Not known: {}\n", line);
  const Table table = joint_table(fit, options.log.logs);
  text += "\n" + table.to_text(2);
  std::vector<std::string> readings;
  for (const JointStiffness& joint : fit.pooled) {
    readings.push_back(fmt::format("joint {}: {}", joint.joint + 1, joint.direction.text));
    for (const std::string& remark : joint.notes)
      readings.push_back(fmt::format("joint {}: {}", joint.joint + 1, remark));
  }
  for (const stiffness::StiffnessAgreement& agreement : fit.agreement) {
    readings.push_back(fmt::format("joint {}: {}", agreement.joint + 1, agreement.text));
  }
  text += "\n";
  for (const std::string& line : readings) text += "  " + line + "\n";

  page::Page page = new_page("Joint stiffness from encoders",
                             fmt::format("{}, {}", robot.name, file_names_of(options.log.logs)));
  for (const data::Log& log : logs) add_log_line(page, log_line(log));
  page.verdict(verdict, judgement);
  for (const std::string& line : missing) page.note("Not known: " + line);
  page.table(table, "Stiffness and hysteresis; errors on stretches that were not fitted");
  page.plots("Deflection over torque, the link channel's delay taken off", loop_plots(logs, fit));
  for (const std::string& line : readings) page.paragraph(line);
  Table terms({"joint", "term", "taken", "error without [µrad]", "with [µrad]", "p", "why"});
  for (const JointStiffness& joint : fit.pooled) {
    for (const stiffness::TermEvidence& term : joint.evidence) {
      terms.add_row({fmt::format("{}", joint.joint + 1), stiffness::to_string(term.term),
                     term.used ? "yes" : "no", page::number(1e6 * term.rms_without, 3),
                     page::number(1e6 * term.rms_with, 3), page::number(term.p_value, 2), term.verdict});
    }
  }
  page.table(terms, "What else was looked for in the deflection");

  nlohmann::ordered_json json{
      {"source", "link encoders"}, {"logs", options.log.logs}, {"joints", nlohmann::ordered_json::array()}};
  put_verdict(json, judgement);
  for (std::size_t k = 0; k < fit.joints.size(); ++k) {
    nlohmann::ordered_json entry = joint_json(fit.pooled[k]);
    if (fit.separate.size() > 1) {
      entry["by_log"] = nlohmann::ordered_json::array();
      for (const auto& log : fit.separate) entry["by_log"].push_back(joint_json(log[k]));
    }
    if (k < fit.agreement.size()) {
      entry["agreement"] = {{"agrees", fit.agreement[k].agrees},
                            {"chi_square", fit.agreement[k].chi_square},
                            {"p_value", fit.agreement[k].p_value}};
    }
    json["joints"].push_back(entry);
  }
  console.print("{}", text);
  finish(console, options.model, options.result, json, page, [&] {
    write_elastic_model(options.model, robot, stiffness, "stiffness", options.log.logs, {verdict});
  });
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
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    diagnosis = diagnose::diagnose(robot, logs, validate, asked);
  }
  VectorXd stiffness = VectorXd::Constant(robot.num_joints(), std::numeric_limits<double>::infinity());
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
    known.push_back(
        fmt::format("joint {} {}", finding.joint + 1, stiffness_in_words(stiffness[finding.joint], false)));
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
    write_elastic_model(options.model, diagnosis.after, stiffness, "stiffness", options.log.logs, {verdict});
  });
}

/// @param torque  gets what the torque is suspected of
std::vector<data::Log> read_all(const std::vector<std::string>& paths, const StiffnessCommandOptions& options,
                                const model::Robot& robot, host::Judgement& torque) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.torque = true;
  std::vector<data::Log> logs;
  needs.torque_constant = options.log.torque_constant;
  for (const std::string& path : paths) {
    logs.push_back(data::read_log(path, needs));
    data::refuse_errors(data::check_log(logs.back(), limits_of(robot)));
    torque.add(judge_torque(logs.back(), robot, options.log, options.log.measured_at()));
  }
  return logs;
}

}  // namespace

void stiffness_from_motion(const StiffnessCommandOptions& options) {
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  host::Judgement torque;
  const std::vector<data::Log> logs = read_all(options.log.logs, options, loaded.robot, torque);
  if (!stiffness::link_encoder_joints(logs.front()).empty())
    return from_link_encoders(options, loaded, logs, torque);
  if (options.validate.empty()) {
    throw UsageError(
        "the log has no link-side encoders (columns qlink1..); from the motor's side alone an elastic joint "
        "is taken only "
        "when a log that the fit has not seen confirms it: give one with --validate LOG.csv");
  }
  const std::vector<data::Log> validate = read_all(options.validate, options, loaded.robot, torque);
  from_motor_side(options, loaded.robot, logs, validate, torque);
}

}  // namespace heft::tools
