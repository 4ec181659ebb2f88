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
using page::Table;
using stiffness::StiffnessEstimate;
using stiffness::StiffnessFit;

namespace {

/// 1, 1e3 or 1e6, and the letter for it.
std::pair<double, const char*> prefix_of(double value) {
  if (std::abs(value) >= 1e6) return {1e6, "M"};
  if (std::abs(value) >= 1e3) return {1e3, "k"};
  return {1.0, ""};
}

const char* unit_of(bool prismatic) { return prismatic ? "N/m" : "N·m/rad"; }

}  // namespace

bool slides(const model::Robot& robot, int joint) {
  return robot.joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
}

std::string stiffness_in_words(double stiffness, bool prismatic) {
  if (std::isnan(stiffness)) return "–";
  if (std::isinf(stiffness)) return "∞";
  const auto [scale, letter] = prefix_of(stiffness);
  return fmt::format("{} {}{}", page::number(stiffness / scale, 3), letter, unit_of(prismatic));
}

std::string stiffness_interval_in_words(double low, double high, bool prismatic) {
  if (std::isnan(low)) return "–";
  if (!std::isfinite(high))
    return low > 0.0 ? "at least " + stiffness_in_words(low, prismatic) : std::string("–");
  const auto [scale, letter] = prefix_of(low);
  return fmt::format("{} to {} {}{}", page::number(low / scale, 3), page::number(high / scale, 3), letter,
                     unit_of(prismatic));
}

namespace {

std::string finite_millimetres(double metres) {
  return std::isfinite(metres) ? fmt::format("{} mm", page::number(1e3 * metres, 3)) : std::string("–");
}

Table joint_table(const StiffnessFit& fit, const model::Robot& robot) {
  Table table({"joint", "stiffness", "95 % interval", "compliance [1e-6 rad/(N·m), 1e-6 m/N]", "remark"});
  for (int j = 0; j < robot.num_joints(); ++j) {
    const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    std::string remark = joint.why;
    if (joint.determined && remark.empty() && std::isinf(joint.stiffness.upper)) {
      remark = "may be rigid: its compliance is within the scatter";
    }
    table.add_row(
        {fmt::format("{}", j + 1), stiffness_in_words(joint.stiffness.value, slides(robot, j)),
         stiffness_interval_in_words(joint.stiffness.lower, joint.stiffness.upper, slides(robot, j)),
         joint.determined ? fmt::format("{} ± {}", page::number(1e6 * joint.compliance.value, 3),
                                        page::number(1e6 * joint.compliance.std, 2))
                          : "–",
         remark});
  }
  return table;
}

Table pose_table(const StiffnessFit& fit) {
  Table table({"pose", "1/k_F", "residual [mm]", "error when left out [mm]", "shift [standard deviations]"});
  for (const stiffness::PoseInfluence& pose : fit.poses) {
    const auto number = [](double v) { return std::isfinite(v) ? page::number(v, 3) : std::string("–"); };
    table.add_row({pose.name,
                   pose.dexterity < stiffness::kSingularDexterity ? "0" : page::number(pose.dexterity, 2),
                   number(1e3 * pose.residual), number(1e3 * pose.left_out),
                   std::isfinite(pose.shift) ? page::number(pose.shift, 2) : "needed"});
  }
  return table;
}

Table trial_table(const stiffness::StiffnessDiagnosis& diagnosis) {
  Table table({"what may lie between springs and readings", "parameter", "residual [mm]",
               "error on poses left out [mm]", "p"});
  const auto number = [](double v) { return std::isfinite(v) ? page::number(v, 3) : std::string("–"); };
  table.add_row({"nothing (springs alone)", "", number(1e3 * diagnosis.before.fit_rms),
                 number(1e3 * diagnosis.before.left_out_rms), ""});
  table.add_row({"no springs: the mean of the other readings", "", "", number(1e3 * diagnosis.mean_rms), ""});
  for (const stiffness::StiffnessTrial& trial : diagnosis.trials) {
    if (!trial.possible) {
      table.add_row({trial.id + ": " + trial.meaning, "", "", trial.why, ""});
      continue;
    }
    table.add_row({trial.id + ": " + trial.meaning,
                   std::isfinite(trial.parameter) ? page::number(trial.parameter, 3) + " " + trial.unit : "",
                   number(1e3 * trial.fit_rms), number(1e3 * trial.left_out_rms),
                   page::number(trial.p_value, 2)});
  }
  return table;
}

nlohmann::ordered_json fit_json(const StiffnessFit& fit) {
  nlohmann::ordered_json json;
  for (const char* name : {"stiffness", "stiffness_low", "stiffness_high", "compliance", "compliance_std",
                           "determined", "missing"}) {
    json[name] = nlohmann::ordered_json::array();
  }
  for (const StiffnessEstimate& joint : fit.joints) {
    // What may as well be rigid has a lower bound and no stiffness.
    json["stiffness"].push_back(joint.has_stiffness() ? joint.stiffness.value : kNaN);
    json["stiffness_low"].push_back(joint.stiffness.lower);
    json["stiffness_high"].push_back(joint.stiffness.upper);
    json["compliance"].push_back(joint.compliance.value);
    json["compliance_std"].push_back(joint.compliance.std);
    json["determined"].push_back(joint.determined);
    json["missing"].push_back(joint.why);
  }
  json["rms"] = fit.fit_rms;
  json["left_out_rms"] = fit.left_out_rms;
  json["repeatability"] = fit.repeatability;
  json["condition_number"] = fit.condition;
  json["readings"] = fit.readings;
  json["unknowns"] = fit.unknowns;
  json["poses"] = nlohmann::ordered_json::array();
  for (const stiffness::PoseInfluence& pose : fit.poses) {
    json["poses"].push_back({{"pose", pose.name},
                             {"dexterity", pose.dexterity},
                             {"residual", pose.residual},
                             {"left_out", pose.left_out},
                             {"shift", pose.shift}});
  }
  return json;
}

nlohmann::ordered_json diagnosis_json(const stiffness::StiffnessDiagnosis& diagnosis) {
  nlohmann::ordered_json json{{"verdict", diagnosis.verdict},
                              {"rms_before", diagnosis.before.fit_rms},
                              {"rms_after", diagnosis.after.fit_rms},
                              {"left_out_rms_before", diagnosis.before.left_out_rms},
                              {"left_out_rms_after", diagnosis.after.left_out_rms},
                              {"left_out_rms_mean", diagnosis.mean_rms}};
  json["accepted"] =
      diagnosis.accepted >= 0
          ? nlohmann::ordered_json(diagnosis.trials[static_cast<std::size_t>(diagnosis.accepted)].id)
          : nlohmann::ordered_json(nullptr);
  json["trials"] = nlohmann::ordered_json::array();
  for (const stiffness::StiffnessTrial& trial : diagnosis.trials) {
    json["trials"].push_back({{"effect", trial.id},
                              {"possible", trial.possible},
                              {"parameter", trial.parameter},
                              {"rms", trial.fit_rms},
                              {"left_out_rms", trial.left_out_rms},
                              {"p_value", trial.p_value}});
  }
  json["correlations"] = nlohmann::ordered_json::array();
  for (const stiffness::ResidualCorrelation& c : diagnosis.correlations) {
    json["correlations"].push_back({{"with", c.with}, {"r", c.coefficient}, {"p_value", c.p_value}});
  }
  return json;
}

/// Stiffnesses with their intervals; a joint that may be rigid has no upper end and is drawn to the top.
page::PlotSpec stiffness_plot(const StiffnessFit& fit, const model::Robot& robot) {
  page::PlotSpec spec;
  spec.title = "Stiffness and 95 % interval";
  spec.y_label = "stiffness [kN·m/rad, kN/m]";
  spec.log_y = true;
  double top = 0.0;
  for (const StiffnessEstimate& joint : fit.joints) {
    for (const double k : {joint.stiffness.lower, joint.stiffness.value, joint.stiffness.upper}) {
      if (std::isfinite(k)) top = std::max(top, k);
    }
  }
  page::Series points{"stiffness", {}, {}}, bars{"95 % interval (to the top: may be rigid)", {}, {}};
  points.style = page::Style::kDots;
  bars.style = page::Style::kIntervals;
  bars.hue = page::Hue::kSky;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    spec.categories.push_back(fmt::format("joint {}", j + 1));
    points.x.push_back(j);
    bars.x.push_back(j);
    points.y.push_back(std::isfinite(joint.stiffness.value) ? 1e-3 * joint.stiffness.value : kNaN);
    bars.y.push_back(1e-3 * joint.stiffness.lower);
    bars.y_high.push_back(
        std::isnan(joint.stiffness.lower) ? kNaN : 1e-3 * std::min(joint.stiffness.upper, 3.0 * top));
  }
  spec.series = {bars, points};
  return spec;
}

page::PlotSpec reading_plot(const std::vector<stiffness::LoadedPose>& poses, const StiffnessFit& fit) {
  page::PlotSpec spec;
  spec.title = "Read and predicted";
  spec.y_label = "deflection [mm, mrad]";
  page::Series read{"read (mean of repeats)", {}, {}}, predicted{"predicted by the fit", {}, {}};
  read.style = predicted.style = page::Style::kDots;
  Index row = 0;
  for (const stiffness::LoadedPose& pose : poses) {
    for (Index r = 0; r < pose.values.size(); ++r, ++row) {
      spec.categories.push_back(poses.size() <= 24 && pose.values.size() == 1 ? pose.name : "");
      read.x.push_back(static_cast<double>(row));
      predicted.x.push_back(static_cast<double>(row));
      read.y.push_back(1e3 * pose.values[r]);
      predicted.y.push_back(1e3 * fit.prediction[row]);
    }
  }
  const bool named =
      std::any_of(spec.categories.begin(), spec.categories.end(), [](const auto& c) { return !c.empty(); });
  if (!named) spec.categories.clear();
  spec.x_label = named ? "pose" : "reading, in the order of the poses";
  spec.series = {read, predicted};
  return spec;
}

Table direct_table(const stiffness::DirectStiffness& direct, const model::Robot& robot) {
  Table table({"joint", "mean of τ/δθ over the poses", "95 % interval"});
  for (int j = 0; j < robot.num_joints(); ++j) {
    table.add_row({fmt::format("{}", j + 1), stiffness_in_words(direct.mean[j], slides(robot, j)),
                   std::isfinite(direct.low[j])
                       ? stiffness_interval_in_words(direct.low[j], direct.high[j], slides(robot, j))
                       : "–"});
  }
  return table;
}

nlohmann::ordered_json direct_json(const stiffness::DirectStiffness& direct) {
  nlohmann::ordered_json json{{"poses", direct.poses},
                              {"stiffness", numbers(direct.mean)},
                              {"stiffness_low", numbers(direct.low)},
                              {"stiffness_high", numbers(direct.high)},
                              {"refused", nlohmann::ordered_json::array()}};
  for (const auto& [pose, why] : direct.refused) json["refused"].push_back({{"pose", pose}, {"why", why}});
  return json;
}

}  // namespace

std::string deflection_verdict(const stiffness::Stiffness& answer) {
  const StiffnessFit& fit = answer.deflections->fit;
  int known = 0, open = 0;
  for (const StiffnessEstimate& joint : fit.joints) {
    known += joint.has_stiffness() ? 1 : 0;
    open += joint.determined && std::isinf(joint.stiffness.upper) ? 1 : 0;
  }
  return fmt::format("{} of {} joints have a stiffness{}; springs alone predict poses left out to {}.", known,
                     answer.robot.num_joints(),
                     open > 0 ? fmt::format(", of {} more only a lower bound is known", open) : std::string(),
                     finite_millimetres(fit.left_out_rms));
}

std::string deflection_text(const stiffness::Stiffness& answer) {
  const stiffness::DeflectionAnswer& from = *answer.deflections;
  const StiffnessFit& fit = from.fit;
  const model::Robot& robot = answer.robot;
  std::string text =
      fmt::format("{}\n{}\n{} readings at {} poses; repeats merged: {} for {} compliances.\n{}",
                  deflection_verdict(answer), verdict_text(answer.judgement), from.readings, fit.poses.size(),
                  fit.readings, fit.unknowns, joint_table(fit, robot).to_text(2));
  text += fmt::format("\nPoses:\n{}", pose_table(fit).to_text(2));
  text += from.direct ? fmt::format("\nDirect method, τ/δθ with δθ = J⁻¹ δd, over {} poses:\n{}",
                                    from.direct->poses.size(), direct_table(*from.direct, robot).to_text(2))
                      : fmt::format("\nDirect method: {}\n", from.no_direct);
  text +=
      fmt::format("\nWhat is left: {}\n{}", from.diagnosis.verdict, trial_table(from.diagnosis).to_text(2));
  return text;
}

void put_deflections(nlohmann::ordered_json& json, const stiffness::Stiffness& answer) {
  const stiffness::DeflectionAnswer& from = *answer.deflections;
  json["source"] = "deflections";
  json["measurements"] = answer.sources;
  put_verdict(json, answer.judgement);
  json.update(fit_json(from.fit));
  json["direct"] = from.direct ? direct_json(*from.direct) : nlohmann::ordered_json(nullptr);
  json["residual"] = diagnosis_json(from.diagnosis);
}

void add_deflections(page::Page& page, const stiffness::Stiffness& answer) {
  const stiffness::DeflectionAnswer& from = *answer.deflections;
  const StiffnessFit& fit = from.fit;
  const model::Robot& robot = answer.robot;
  page.verdict(deflection_verdict(answer), answer.judgement);
  page.facts({{"residual", finite_millimetres(fit.fit_rms), "rms"},
              {"pose left out", finite_millimetres(fit.left_out_rms), "rms error of its readings"},
              {"repeats", finite_millimetres(fit.repeatability), "scatter of their mean"},
              {"condition", page::number(fit.condition, 3), "of the equations"}});
  page.table(joint_table(fit, robot), "Stiffness of the joints");
  page.plot(stiffness_plot(fit, robot));
  page.plot(reading_plot(from.poses, fit));
  page.table(pose_table(fit),
             "Poses: what each one does to the fit (shift: largest change of a compliance without it)");
  page.note(fit.stated_noise ? "Intervals rest on the stated standard deviations of the readings, widened "
                               "where the residual is larger than these."
                             : "Intervals rest on the residual (Student's t); they hold for errors that are "
                               "independent from reading to "
                               "reading. Repeats of a pose count as one.");
  if (from.direct) page.table(direct_table(*from.direct, robot), "Direct method: τ/δθ with δθ = J⁻¹ δd");
  page.heading("Residual of springs alone");
  page.paragraph(from.diagnosis.verdict);
  page.table(trial_table(from.diagnosis),
             "Effects tried together with the springs; p: how often the best of all does as well on shuffled "
             "residuals");
  Table correlations({"the residual against", "correlation", "p"});
  for (const stiffness::ResidualCorrelation& c : from.diagnosis.correlations) {
    correlations.add_row({c.with, fmt::format("{:.2f}", c.coefficient), page::number(c.p_value, 2)});
  }
  page.table(correlations, "Each p for itself, by permutation of the poses");
}

}  // namespace heft::report
