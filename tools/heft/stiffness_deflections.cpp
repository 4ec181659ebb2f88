/// @file
/// heft stiffness --measurements: compliances from loads and deflections.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "console.hpp"
#include "heft/data/deflections.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/stiffness/judgement.hpp"
#include "heft/stiffness/stiffness_effects.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "page_lines.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using page::Table;
using stiffness::StiffnessEstimate;
using stiffness::StiffnessFit;

/// "1-3,4-6" as joints from 0.
std::vector<std::vector<int>> read_groups(const std::string& text, int n) {
  std::vector<std::vector<int>> groups;
  std::vector<bool> taken(static_cast<std::size_t>(n), false);
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("--groups {}: {}; expected joints 1 to {} such as 1-3,4-6 (each joint once)",
                                 text, why, n));
  };
  std::size_t at = 0;
  while (at <= text.size() && !text.empty()) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string part = text.substr(at, comma - at);
    at = comma + 1;
    int first = 0, last = 0, used = 0;
    if (std::sscanf(part.c_str(), "%d-%d%n", &first, &last, &used) != 2 ||
        used != static_cast<int>(part.size())) {
      used = 0;
      if (std::sscanf(part.c_str(), "%d%n", &first, &used) != 1 || used != static_cast<int>(part.size())) {
        refuse(fmt::format("'{}' is no joint and no range of joints", part));
      }
      last = first;
    }
    if (first < 1 || last > n || first > last) refuse(fmt::format("'{}' is not among the joints", part));
    groups.emplace_back();
    for (int j = first - 1; j < last; ++j) {
      if (taken[static_cast<std::size_t>(j)]) refuse(fmt::format("joint {} is in two groups", j + 1));
      taken[static_cast<std::size_t>(j)] = true;
      groups.back().push_back(j);
    }
  }
  return groups;
}

bool slides(const model::Robot& robot, int j) {
  return robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
}

std::string millimetres(double metres) {
  return std::isfinite(metres) ? fmt::format("{} mm", page::number(1e3 * metres, 3)) : std::string("–");
}

Table joint_table(const StiffnessFit& fit, const model::Robot& robot) {
  Table table({"joint", "stiffness", "95 % interval", "compliance [1e-6 rad/(N·m), 1e-6 m/N]", "remark"});
  for (int j = 0; j < robot.num_joints(); ++j) {
    const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    std::string remark = joint.why;
    if (joint.determined && remark.empty() && std::isinf(joint.stiffness_high)) {
      remark = "may be rigid: its compliance does not stand out from the scatter";
    }
    table.add_row({fmt::format("{}", j + 1), stiffness_in_words(joint.stiffness, slides(robot, j)),
                   stiffness_interval_in_words(joint.stiffness_low, joint.stiffness_high, slides(robot, j)),
                   joint.determined ? fmt::format("{} ± {}", page::number(1e6 * joint.compliance, 3),
                                                  page::number(1e6 * joint.deviation, 2))
                                    : "–",
                   remark});
  }
  return table;
}

Table pose_table(const StiffnessFit& fit) {
  Table table({"pose", "1/k_F", "residual [mm]", "error when left out [mm]", "shift [deviations]"});
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
  Table table({"what may stand between springs and readings", "parameter", "residual [mm]",
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
    json["stiffness"].push_back(joint.has_stiffness() ? joint.stiffness : kNaN);
    json["stiffness_low"].push_back(joint.stiffness_low);
    json["stiffness_high"].push_back(joint.stiffness_high);
    json["compliance"].push_back(joint.compliance);
    json["compliance_std"].push_back(joint.deviation);
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
    for (const double k : {joint.stiffness_low, joint.stiffness, joint.stiffness_high}) {
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
    points.y.push_back(std::isfinite(joint.stiffness) ? 1e-3 * joint.stiffness : kNaN);
    bars.y.push_back(1e-3 * joint.stiffness_low);
    bars.y_high.push_back(std::isnan(joint.stiffness_low) ? kNaN
                                                          : 1e-3 * std::min(joint.stiffness_high, 3.0 * top));
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

/// "pose 3", "poses 1, 5".
std::string pose_list(const std::vector<std::string>& names) {
  return fmt::format("{} {}", names.size() == 1 ? "pose" : "poses", fmt::join(names, ", "));
}

void refuse_singular(const std::vector<stiffness::LoadedPose>& poses, bool keep) {
  std::vector<std::string> singular, near;
  for (const stiffness::LoadedPose& pose : poses) {
    if (pose.dexterity >= stiffness::kLeastDexterity) continue;
    auto& list = pose.dexterity < stiffness::kSingularDexterity ? singular : near;
    if (std::find(list.begin(), list.end(), pose.name) == list.end()) list.push_back(pose.name);
  }
  if (!near.empty()) {
    note(fmt::format(
        "{} close to a singular pose (1/k_F below {:g}): what is read there depends strongly on errors of "
        "the angles",
        pose_list(near), stiffness::kLeastDexterity));
  }
  if (singular.empty()) return;
  if (!keep) {
    throw NotIdentifiableError(
        fmt::format("{} singular: the Jacobian has no inverse there, the tool is rigid in some direction "
                    "whatever the joints do; "
                    "expected poses with 1/k_F above {:g}; measure at others (--plan N names some), or fit "
                    "these all the same with "
                    "--keep-singular",
                    pose_list(singular), stiffness::kLeastDexterity));
  }
  note(fmt::format("{} singular and kept; the direct method leaves them out", pose_list(singular)));
}

/// The file itself, or one of that name that comes with heft.
std::string measurement_file(const std::string& name) {
  std::error_code ignored;
  if (std::filesystem::exists(name, ignored)) return name;
  try {
    return urdf::resolve_measurements(name);
  } catch (const DataError&) {
    return name;  // whose reader says what is wrong with it
  }
}

std::string verdict_of(const StiffnessFit& fit, const model::Robot& robot) {
  int known = 0, open = 0;
  for (const StiffnessEstimate& joint : fit.joints) {
    known += joint.has_stiffness() ? 1 : 0;
    open += joint.determined && std::isinf(joint.stiffness_high) ? 1 : 0;
  }
  return fmt::format("{} of {} joints have a stiffness{}; springs alone predict poses left out to {}.", known,
                     robot.num_joints(),
                     open > 0 ? fmt::format(", of {} more only a lower bound is known", open) : std::string(),
                     millimetres(fit.left_out_rms));
}

}  // namespace

void stiffness_from_deflections(const StiffnessCommandOptions& options) {
  const Console console{options.result.json, options.model, options.compensated};
  const model::Robot robot = load_robot(options.robot);
  const model::Kinematics kinematics(robot);
  std::vector<data::Deflection> rows;
  for (const std::string& path : options.measurements) {
    std::vector<std::string> notes;
    const std::vector<data::Deflection> read =
        data::read_deflections(measurement_file(path), robot.num_joints(), robot.name, &notes);
    for (const std::string& text : notes) note(text);
    rows.insert(rows.end(), read.begin(), read.end());
  }
  const std::vector<stiffness::LoadedPose> poses = stiffness::loaded_poses(kinematics, rows);
  const double length = stiffness::shared_length(poses);
  refuse_singular(poses, options.keep_singular);

  stiffness::StiffnessOptions asked;
  asked.groups = read_groups(options.groups, robot.num_joints());
  const stiffness::StiffnessDiagnosis diagnosis = stiffness::diagnose_stiffness(
      kinematics, poses, asked, stiffness::known_stiffness_effects(robot), length);
  asked.complementary = options.complementary;
  const bool changed = diagnosis.accepted >= 0;
  const StiffnessFit fit = options.complementary && !changed
                               ? stiffness::fit_stiffness(kinematics, poses, asked, length)
                               : diagnosis.after;

  std::string direct_text;
  Table direct_table({"joint", "mean of τ/δθ over the poses", "95 % interval"});
  nlohmann::ordered_json direct_json = nullptr;
  try {
    const stiffness::DirectStiffness direct = stiffness::direct_stiffness(poses, options.missing_is_zero);
    for (int j = 0; j < robot.num_joints(); ++j) {
      direct_table.add_row({fmt::format("{}", j + 1), stiffness_in_words(direct.mean[j], slides(robot, j)),
                            std::isfinite(direct.low[j])
                                ? stiffness_interval_in_words(direct.low[j], direct.high[j], slides(robot, j))
                                : "–"});
    }
    direct_json = {{"poses", direct.poses},
                   {"stiffness", nlohmann::ordered_json::array()},
                   {"stiffness_low", nlohmann::ordered_json::array()},
                   {"stiffness_high", nlohmann::ordered_json::array()},
                   {"refused", nlohmann::ordered_json::array()}};
    for (int j = 0; j < robot.num_joints(); ++j) {
      direct_json["stiffness"].push_back(direct.mean[j]);
      direct_json["stiffness_low"].push_back(direct.low[j]);
      direct_json["stiffness_high"].push_back(direct.high[j]);
    }
    for (const auto& [pose, why] : direct.refused)
      direct_json["refused"].push_back({{"pose", pose}, {"why", why}});
    direct_text = fmt::format("\nDirect method, τ/δθ with δθ = J⁻¹ δd, over {} poses:\n{}",
                              direct.poses.size(), direct_table.to_text(2));
  } catch (const NotIdentifiableError& error) {
    direct_text = fmt::format("\nDirect method: {}\n", error.what());
  }

  VectorXd stiffness(robot.num_joints());
  for (Index j = 0; j < stiffness.size(); ++j) {
    const StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    stiffness[j] = joint.has_stiffness() ? joint.stiffness : std::numeric_limits<double>::infinity();
  }

  const std::string verdict = verdict_of(fit, robot);
  const host::Judgement judgement = stiffness::judge(fit, diagnosis);
  const bool none = std::none_of(fit.joints.begin(), fit.joints.end(),
                                 [](const StiffnessEstimate& joint) { return joint.has_stiffness(); });
  int readings = 0;
  for (const data::Deflection& row : rows) readings += static_cast<int>(row.readings.size());
  std::string text =
      fmt::format("{}\n{}\n{} readings at {} poses; repeats merged: {} for {} compliances.\n{}", verdict,
                  verdict_text(judgement), readings, fit.poses.size(), fit.readings, fit.unknowns,
                  joint_table(fit, robot).to_text(2));
  text += fmt::format("\nPoses:\n{}", pose_table(fit).to_text(2));
  text += direct_text;
  text += fmt::format("\nWhat is left: {}\n{}", diagnosis.verdict, trial_table(diagnosis).to_text(2));

  page::Page page = new_page("Joint stiffness", robot.name);
  page.verdict(verdict, judgement);
  page.facts({{"residual", millimetres(fit.fit_rms), "rms"},
              {"pose left out", millimetres(fit.left_out_rms), "rms error of its readings"},
              {"repeats", millimetres(fit.repeatability), "scatter of their mean"},
              {"condition", page::number(fit.condition, 3), "of the equations"}});
  page.table(joint_table(fit, robot), "Stiffness of the joints");
  page.plot(stiffness_plot(fit, robot));
  page.plot(reading_plot(poses, fit));
  page.table(pose_table(fit),
             "Poses: what each one does to the fit (shift: largest change of a compliance without it)");
  page.note(fit.stated_noise ? "Intervals rest on the stated deviations of the readings, widened where the "
                               "residual is larger than these."
                             : "Intervals rest on the residual (Student's t); they hold for errors that are "
                               "independent from reading to "
                               "reading. Repeats of a pose count as one.");
  if (!direct_json.is_null()) page.table(direct_table, "Direct method: τ/δθ with δθ = J⁻¹ δd");
  page.heading("What springs alone leave");
  page.paragraph(diagnosis.verdict);
  page.table(trial_table(diagnosis),
             "Effects tried together with the springs; p: how often the best of all does as well on shuffled "
             "residuals");
  Table correlations({"the residual against", "correlation", "p"});
  for (const stiffness::ResidualCorrelation& c : diagnosis.correlations) {
    correlations.add_row({c.with, fmt::format("{:.2f}", c.coefficient), page::number(c.p_value, 2)});
  }
  page.table(correlations, "Each p for itself, by permutation of the poses");

  nlohmann::ordered_json json{{"source", "deflections"}, {"measurements", options.measurements}};
  put_verdict(json, judgement);
  json.update(fit_json(fit));
  json["direct"] = direct_json;
  json["residual"] = diagnosis_json(diagnosis);
  std::vector<NamedPose> named;
  for (const stiffness::PoseInfluence& influence : fit.poses) {
    const auto pose =
        std::find_if(poses.begin(), poses.end(), [&](const auto& p) { return p.name == influence.name; });
    named.push_back({influence.name, pose->q});
  }
  constexpr std::size_t kMostPoses = 12;
  if (named.size() > kMostPoses) named.resize(kMostPoses);
  const ToolDescription tool =
      describe_tool(kinematics, stiffness, named, read_path(options, robot), options, json, page);
  text += tool.text;

  console.print("{}", text);
  // What the readings do not show is not written.
  StiffnessCommandOptions written = options;
  if (none) written.model.clear();
  finish_with_path(console, written, json, page, tool.compensated, [&] {
    write_elastic_model(written.model, robot, stiffness, "stiffness", options.measurements,
                        {verdict, diagnosis.verdict});
  });
  if (none) {
    throw NotIdentifiableError(fmt::format(
        "no joint's stiffness can be determined from these readings{}: expected intervals with two ends; "
        "measure at more poses, with larger loads, or let joints with gears of one size share a stiffness "
        "(--groups 1-3,4-6)",
        options.model.empty() ? "" : ", nothing was written to " + options.model));
  }
}

}  // namespace heft::tools
