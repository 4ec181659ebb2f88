#include "stiffness_parts.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "page_lines.hpp"

namespace heft::report {

using Eigen::Index;
using Eigen::VectorXd;
using page::Table;
using statistics::Interval;
using stiffness::JointEncoderFit;
using stiffness::JointStiffness;

namespace {

nlohmann::ordered_json to_json(const Interval& u) {
  return {{"value", u.value}, {"std", u.std}, {"lower", u.lower}, {"upper", u.upper}};
}

/// A loop's width in µrad with its deviation.
std::string microradians(const Interval& u) {
  return fmt::format("{} ± {}", page::number(1e6 * u.value, 3), page::number(1e6 * u.std, 2));
}

std::vector<std::string> row_of(const std::string& log, const JointStiffness& joint) {
  return {fmt::format("{}", joint.joint + 1),
          log,
          joint.identifiable ? stiffness_in_words(joint.stiffness.value, false) : "–",
          stiffness_interval_in_words(joint.stiffness.lower, joint.stiffness.upper, false),
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
                              {"stiffness", joint.stiffness.value},
                              {"stiffness_std", joint.stiffness.std},
                              {"stiffness_low", joint.stiffness.lower},
                              {"stiffness_high", joint.stiffness.upper},
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
    double low = kInfinity, high = -low, sum = 0.0;
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

std::vector<std::string> readings_of(const JointEncoderFit& fit) {
  std::vector<std::string> readings;
  for (const JointStiffness& joint : fit.pooled) {
    readings.push_back(fmt::format("joint {}: {}", joint.joint + 1, joint.direction.text));
    for (const std::string& remark : joint.notes)
      readings.push_back(fmt::format("joint {}: {}", joint.joint + 1, remark));
  }
  for (const stiffness::StiffnessAgreement& agreement : fit.agreement) {
    readings.push_back(fmt::format("joint {}: {}", agreement.joint + 1, agreement.text));
  }
  return readings;
}

/// "joint 2: why", one a joint without stiffness.
std::vector<std::string> missing_of(const JointEncoderFit& fit) {
  std::vector<std::string> missing;
  for (const JointStiffness& joint : fit.pooled) {
    if (!joint.identifiable) missing.push_back(fmt::format("joint {}: {}", joint.joint + 1, joint.reason));
  }
  return missing;
}

}  // namespace

std::string encoder_verdict(const stiffness::Stiffness& answer) {
  std::vector<std::string> known;
  for (const JointStiffness& joint : answer.encoders->pooled) {
    if (joint.identifiable)
      known.push_back(
          fmt::format("joint {} {}", joint.joint + 1, stiffness_in_words(joint.stiffness.value, false)));
  }
  return fmt::format("Stiffness of the gears: {}.", fmt::join(known, ", "));
}

std::string encoder_text(const stiffness::Stiffness& answer) {
  const JointEncoderFit& fit = *answer.encoders;
  std::string text = encoder_verdict(answer) + "\n" + verdict_text(answer.judgement);
  for (const std::string& line : missing_of(fit)) text += fmt::format("Not known: {}\n", line);
  text += "\n" + joint_table(fit, answer.sources).to_text(2) + "\n";
  for (const std::string& line : readings_of(fit)) text += "  " + line + "\n";
  return text;
}

void put_encoders(nlohmann::ordered_json& json, const stiffness::Stiffness& answer) {
  const JointEncoderFit& fit = *answer.encoders;
  json["source"] = "link encoders";
  json["logs"] = answer.sources;
  json["joints"] = nlohmann::ordered_json::array();
  put_verdict(json, answer.judgement);
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
}

void add_encoders(page::Page& page, const stiffness::Stiffness& answer, const std::vector<data::Log>& logs) {
  const JointEncoderFit& fit = *answer.encoders;
  page.verdict(encoder_verdict(answer), answer.judgement);
  for (const std::string& line : missing_of(fit)) page.note("Not known: " + line);
  page.table(joint_table(fit, answer.sources),
             "Stiffness and hysteresis; errors on stretches that were not fitted");
  if (!logs.empty())
    page.plots("Deflection over torque, the link channel's delay taken off", loop_plots(logs, fit));
  for (const std::string& line : readings_of(fit)) page.paragraph(line);
  Table terms({"joint", "term", "taken", "error without [µrad]", "with [µrad]", "p", "why"});
  for (const JointStiffness& joint : fit.pooled) {
    for (const stiffness::TermEvidence& term : joint.evidence) {
      terms.add_row({fmt::format("{}", joint.joint + 1), stiffness::to_string(term.term),
                     term.used ? "yes" : "no", page::number(1e6 * term.rms_without, 3),
                     page::number(1e6 * term.rms_with, 3), page::number(term.p_value, 2), term.verdict});
    }
  }
  page.table(terms, "Other terms tested in the deflection");
}

}  // namespace heft::report
