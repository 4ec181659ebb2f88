#include "heft/report/payload.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "payload_changes.hpp"
#include "torque_score.hpp"
#include "tracking_runs.hpp"

namespace heft::report {
namespace {

using payload::Payload;
using payload::UnloadedArm;

constexpr std::array<const char*, 3> kComNames{"x", "y", "z"};
constexpr std::array<const char*, 6> kInertiaNames{"Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};

using Estimates = std::vector<payload::Estimated>;

/// What is not identifiable is null: a number there would be the prior's, not the data's.
nlohmann::ordered_json estimate_json(const Estimates& estimates, bool withdrawn = false) {
  const auto list = [&](const auto& number_of) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(estimates.size()));
    std::transform(estimates.begin(), estimates.end(), values.begin(), [&](const payload::Estimated& e) {
      return e.identifiable && !withdrawn ? number_of(e) : kNaN;
    });
    return host::json_array(values);
  };
  std::vector<bool> identifiable;
  for (const payload::Estimated& e : estimates) identifiable.push_back(e.identifiable && !withdrawn);
  return {{"value", list([](const payload::Estimated& e) { return e.value; })},
          {"std", list([](const payload::Estimated& e) { return e.std; })},
          {"half_width_95", list([](const payload::Estimated& e) { return e.half_width(); })},
          {"identifiable", identifiable}};
}

/// A number and half the width of its interval, "–" for what is not known.
std::pair<std::string, std::string> cells(const payload::Estimated& estimate, int digits = 4) {
  if (!estimate.identifiable) return {"–", "–"};
  return {page::number(estimate.value, digits), page::number(estimate.half_width(), 2)};
}

void add_rows(page::Table& table, const std::string& what, const char* unit, const Estimates& estimates,
              const char* const* names) {
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const auto [value, half] = cells(estimates[k]);
    table.add_row({names ? fmt::format("{} {}", what, names[k]) : what, value, half, unit,
                   estimates[k].identifiable ? "" : "not identifiable from this motion"});
  }
}

page::Table estimate_table(const Payload& result) {
  page::Table table({"", "value", "± 95 %", "unit", ""});
  add_rows(table, "mass", "kg", {result.run.mass}, nullptr);
  add_rows(table, "first moment", "kg·m", result.run.first_moment, kComNames.data());
  add_rows(table, "centre of mass", "m", result.run.com, kComNames.data());
  add_rows(table, "inertia", "kg·m²", result.run.inertia, kInertiaNames.data());
  return table;
}

/// What each joint feels of the load; empty where that says nothing.
page::Table scale_table(const Payload& result) {
  page::Table table({"joint", "torque scale", "± 95 %"});
  for (std::size_t j = 0; j < result.run.torque_scale.size(); ++j) {
    const auto [scale, half] = cells(result.run.torque_scale[j], 3);
    table.add_row({fmt::format("{}", j + 1), scale, half});
  }
  return table;
}

constexpr const char* kScaleMeaning =
    "Torque of the load that each joint shows, relative to what the load found predicts for it; 1 where the joints agree, "
    "– where the load hardly acts on a joint";

page::Table torque_error_table(const Payload& result) {
  std::vector<std::string> headers{"joint", "RMSE before [N·m]"};
  if (result.after) {
    headers.insert(headers.end(), {"after", "change [%]"});
    if (result.after_friction) headers.push_back("and friction as found");
  }
  if (result.before.rmse_in_band.size() > 0) headers.push_back("in band before");
  if (result.after) headers.push_back("in band after");
  page::Table table(headers);
  for (Eigen::Index j = 0; j < result.before.rmse.size(); ++j) {
    std::vector<std::string> row{fmt::format("{}", j + 1), page::number(result.before.rmse[j])};
    if (result.after) {
      row.push_back(page::number(result.after->rmse[j]));
      row.push_back(fmt::format("{:+.0f}", 100.0 * (result.after->rmse[j] / result.before.rmse[j] - 1.0)));
      if (result.after_friction) row.push_back(page::number(result.after_friction->rmse[j]));
    }
    if (result.before.rmse_in_band.size() > 0) row.push_back(page::number(result.before.rmse_in_band[j]));
    if (result.after) row.push_back(page::number(result.after->rmse_in_band[j]));
    table.add_row(row);
  }
  return table;
}

/// "0.985 ± 0.022, 0.990 ± 0.002", one a joint.
std::string scales_in_words(const std::vector<statistics::Interval>& scales) {
  std::string text;
  for (const statistics::Interval& scale : scales) {
    text += fmt::format("{}{:.3f} ± {:.3f}", text.empty() ? "" : ", ", scale.value, scale.half_width());
  }
  return text;
}

/// What an error of a torque constant does to the mass, the joint that matters most first.
std::string budget_in_words(const Eigen::VectorXd& share) {
  constexpr double kGainError = 0.03, kWorthNaming = 0.1;
  std::vector<Eigen::Index> joints;
  for (Eigen::Index j = 0; j < share.size(); ++j)
    if (std::abs(share[j]) >= kWorthNaming) joints.push_back(j);
  std::sort(joints.begin(), joints.end(),
            [&](Eigen::Index a, Eigen::Index b) { return std::abs(share[a]) > std::abs(share[b]); });
  std::string text;
  for (const Eigen::Index j : joints) {
    text += text.empty() ? fmt::format("{:.0f} % on the gain of joint {} puts {:.1f} % on the mass",
                                       100.0 * kGainError, j + 1, 100.0 * kGainError * share[j])
                         : fmt::format(", of joint {} {:.1f} %", j + 1, 100.0 * kGainError * share[j]);
  }
  return text.empty() ? "No single joint's gain matters for the mass." : text + ".";
}

/// Where the interval comes from, and what it leaves out.
std::vector<std::string> remarks(const Payload& result) {
  std::vector<std::string> lines;
  if (!result.run.missing.empty()) lines.push_back(fmt::format("Not determined: {}.", result.run.missing));
  if (result.run.mass.identifiable) {
    const std::string parts = fmt::format(
        "this log's residual {}, model {}, zero check {}{}", page::number(result.run.mass_std_residual, 2),
        page::number(result.run.mass_std_model, 2), page::number(result.run.mass_std_zero, 2),
        result.drive_scale.empty() ? "" : ", torque scale " + page::number(result.run.mass_std_scale, 2));
    lines.push_back(fmt::format(
        "Standard deviation of the mass [kg]: {}; from {} blocks of {:.3g} s, since the residual is "
        "correlated in time.",
        parts, result.run.blocks, result.run.block));
    if (!result.has_model_covariance) {
      lines.push_back(
          "The model file holds no covariance, so the interval leaves the model's own error out.");
    }
    if (result.drive_scale.empty()) {
      lines.push_back(
          "The interval holds for the torque scale given: torque constants that are 2 % off move the mass by 2 "
          "%.");
    } else {
      lines.push_back(fmt::format(
          "Torque scale from the controller's target torque, measured torque in parts of it: {}; taken off the load, and in "
          "its interval.",
          scales_in_words(result.drive_scale)));
    }
    if (result.run.gain_share.size() > 0) lines.push_back(budget_in_words(result.run.gain_share));
  }
  for (const payload::ZeroCheck& check : result.zero_checks) {
    lines.push_back(fmt::format("Zero check, {}: {} ± {} kg where there is no load.", check.log,
                                page::number(check.mass.value, 2), page::number(check.mass.half_width(), 2)));
  }
  if (result.run.mass.identifiable && result.zero_checks.empty()) {
    lines.push_back(
        "No zero check: the model's error from one day to the next is not in the interval (--zero takes a "
        "log without load).");
  }
  lines.insert(lines.end(), result.notes.begin(), result.notes.end());
  return lines;
}

/// What a controller says, and when.
std::string live_words(const Payload& result) {
  const payload::LiveEvent* first = result.first_stated();
  if (first == nullptr) return "A controller that runs heft::LoadObserver would state no load.";
  std::string text = fmt::format("A controller that runs heft::LoadObserver states {} kg ± {} kg at {:.3g} s",
                                 page::number(first->load.mass.value, 3),
                                 page::number(first->load.mass.half_width(), 2), first->time);
  const auto later =
      std::count_if(result.live.begin(), result.live.end(), [](const payload::LiveEvent& event) {
        using LoadEvent = payload::LiveEvent::Kind;
        return event.kind == LoadEvent::kAttached || event.kind == LoadEvent::kDetached ||
               event.kind == LoadEvent::kReplaced;
      });
  return text + (later == 0   ? "."
                 : later == 1 ? ", then 1 change."
                              : fmt::format(", then {} changes.", later));
}

/// Range of the mass plot: that of the values known after the first tenth of the run, so that the wild
/// values at the start do not flatten the rest.
std::pair<double, double> settled_range(const Payload& result) {
  double low = std::min(0.0, result.true_mass.value_or(0.0));
  double high = std::max(0.0, result.true_mass.value_or(0.0));
  for (Eigen::Index k = result.run.time.size() / 10; k < result.run.time.size(); ++k) {
    if (!std::isfinite(result.run.mass_history[k])) continue;
    if (result.run.mass_std_history.size() == result.run.time.size() &&
        !std::isfinite(result.run.mass_std_history[k]))
      continue;
    low = std::min(low, result.run.mass_history[k]);
    high = std::max(high, result.run.mass_history[k]);
  }
  if (!(high > low)) high = low + 1.0;
  const double margin = 0.15 * (high - low);
  return {low - margin, high + margin};
}

page::PlotSpec mass_plot(const Payload& result) {
  page::PlotSpec spec;
  spec.title = "Mass of the load";
  spec.x_label = "time [s]";
  spec.y_label = "mass [kg]";
  if (result.run.mass_std_history.size() == result.run.time.size()) {
    const Eigen::VectorXd half = statistics::kNormal95 * result.run.mass_std_history;
    spec.series.push_back(page::band("95 % interval", result.run.time, result.run.mass_history - half,
                                     result.run.mass_history + half, page::Hue::kBlue));
  }
  spec.series.push_back(page::line("estimate", result.run.time, result.run.mass_history, page::Hue::kBlue));
  for (const payload::LoadChange& change : result.run.changes) {
    spec.marks.push_back({page::Mark::Direction::kVertical, change.time, "change"});
  }
  if (result.true_mass) {
    spec.marks.push_back({page::Mark::Direction::kHorizontal, *result.true_mass,
                          fmt::format("true {} kg", page::number(*result.true_mass))});
  }
  spec.y_range = settled_range(result);
  return spec;
}

/// One plot a joint: the torque error over time.
std::vector<page::PlotSpec> error_plots(const Payload& result) {
  std::vector<page::PlotSpec> plots;
  for (Eigen::Index j = 0; j < result.error_before.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "torque error [N·m]";
    spec.series.push_back(
        page::line("without the load", result.time, result.error_before.col(j), page::Hue::kNeutral));
    if (result.after) {
      spec.series.push_back(
          page::line("with the load found", result.time, result.error_after.col(j), page::Hue::kBlue));
    }
    plots.push_back(std::move(spec));
  }
  return plots;
}

page::Table residual_table(const statistics::ResidualStatistics& residual) {
  page::Table table({"joint", "residual of the model, filtered [N·m]", "correlated over [s]"});
  for (Eigen::Index j = 0; j < residual.std.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), page::number(residual.std[j]),
                   page::number(residual.correlation_time[j], 2)});
  }
  return table;
}

std::string dumped(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

nlohmann::ordered_json to_json(const Payload& result) {
  nlohmann::ordered_json json{{"robot", result.robot}, {"log", result.log}};
  put_verdict(json, result.judgement);
  // What contradicts itself is no number to go on with.
  const bool has_mass = result.run.mass.identifiable && result.contradiction.empty();
  json["mass"] = {
      {"value", has_mass ? host::number_or_null(result.run.mass.value) : nlohmann::ordered_json(nullptr)},
      {"std", has_mass ? host::number_or_null(result.run.mass.std) : nlohmann::ordered_json(nullptr)},
      {"half_width_95",
       has_mass ? host::number_or_null(result.run.mass.half_width()) : nlohmann::ordered_json(nullptr)},
      {"identifiable", has_mass}};
  const bool withdrawn = !result.contradiction.empty();
  if (!result.run.first_moment.empty())
    json["first_moment"] = estimate_json(result.run.first_moment, withdrawn);
  json["com"] = estimate_json(result.run.com, withdrawn);
  json["inertia"] = estimate_json(result.run.inertia, withdrawn);
  if (!result.run.torque_scale.empty()) json["torque_scale"] = estimate_json(result.run.torque_scale);
  if (!result.drive_scale.empty()) {
    Estimates scales;
    for (const statistics::Interval& scale : result.drive_scale) scales.push_back({scale, true});
    json["drive_scale"] = estimate_json(scales);
  }
  if (result.run.gain_share.size() > 0) json["gain_share"] = host::json_array(result.run.gain_share);
  json["inertia"]["order"] = kInertiaNames;
  json["rows"] = result.run.first_joint;
  json["samples"] = result.run.samples;
  json["converged_at"] = result.run.converged_at ? nlohmann::ordered_json(*result.run.converged_at)
                                                 : nlohmann::ordered_json(nullptr);
  const payload::LiveEvent* stated = result.first_stated();
  json["stated_at"] = stated ? nlohmann::ordered_json(stated->time) : nlohmann::ordered_json(nullptr);
  json["changes"] = changes_json(result.run.changes);
  if (result.before.rmse.size() > 0) {
    json["rmse_before"] = host::json_array(result.before.rmse);
    if (result.after) json["rmse_after"] = host::json_array(result.after->rmse);
    if (result.after_friction)
      json["rmse_after_with_friction"] = host::json_array(result.after_friction->rmse);
  }
  if (result.before.rmse_in_band.size() > 0) {
    json["rmse_in_band_before"] = host::json_array(result.before.rmse_in_band);
    if (result.after) json["rmse_in_band_after"] = host::json_array(result.after->rmse_in_band);
    json["band_hz"] =
        result.before.band > 0 ? nlohmann::ordered_json(result.before.band) : nlohmann::ordered_json(nullptr);
  }
  if (!result.frame.empty()) json["frame"] = result.frame;
  if (!result.run.missing.empty()) json["missing"] = result.run.missing;
  if (result.run.cutoff > 0) json["cutoff_hz"] = result.run.cutoff;
  if (!result.zero_checks.empty()) {
    json["zero_checks"] = nlohmann::ordered_json::array();
    for (const payload::ZeroCheck& check : result.zero_checks) {
      json["zero_checks"].push_back(
          {{"log", check.log}, {"mass", check.mass.value}, {"std", check.mass.std}});
    }
  }
  return json;
}

void add_to(page::Page& page, const Payload& result) {
  page.verdict(brief(result), result.judgement);
  std::vector<page::Fact> facts;
  if (result.run.mass.identifiable) {
    facts.push_back({"mass", page::number(result.run.mass.value) + " kg",
                     "± " + page::number(result.run.mass.half_width(), 2) + " kg (95 %)"});
  }
  facts.push_back(
      {"converged at", result.run.converged_at ? fmt::format("{:.3g} s", *result.run.converged_at) : "–",
       result.first_stated() ? fmt::format("a controller states it at {:.3g} s", result.first_stated()->time)
                             : ""});
  facts.push_back({"samples", fmt::format("{}", result.run.samples),
                   fmt::format("torque of joints {} and up", result.run.first_joint)});
  page.facts(facts);
  if (result.run.time.size() > 0) page.plot(mass_plot(result));
  page.table(estimate_table(result), fmt::format("The load in {}; inertia about its origin",
                                                 result.frame.empty() ? "the flange frame" : result.frame));
  for (const std::string& line : remarks(result)) page.note(line);
  if (!result.run.torque_scale.empty()) page.table(scale_table(result), kScaleMeaning);
  if (result.before.rmse.size() > 0) {
    page::PlotSpec spec;
    spec.title = "Torque error per joint";
    spec.y_label = "RMSE [N·m]";
    spec.series = {page::bars("without the load", to_vector(result.before.rmse), page::Hue::kNeutral)};
    if (result.after) {
      spec.series.push_back(
          page::bars("with the load found", to_vector(result.after->rmse), page::Hue::kBlue));
    }
    spec.categories = joint_names(result.before.rmse.size());
    page.plot(spec);
    page.table(torque_error_table(result), score_meaning(result.before));
  }
}

}  // namespace

nlohmann::ordered_json changes_json(const std::vector<payload::LoadChange>& changes) {
  auto list = nlohmann::ordered_json::array();
  for (const payload::LoadChange& change : changes) {
    nlohmann::ordered_json entry{{"time", change.time}, {"mass", host::number_or_null(change.mass)}};
    if (std::isfinite(change.std)) entry["std"] = change.std;
    if (std::isfinite(change.mass_before)) entry["mass_before"] = change.mass_before;
    list.push_back(std::move(entry));
  }
  return list;
}

std::string brief(const Payload& result) {
  if (!result.run.mass.identifiable) return "The mass of the load cannot be determined from this motion.";
  if (!result.contradiction.empty()) {
    return fmt::format("The load of this log is impossible: {} kg ± {} kg (95 %).",
                       page::number(result.run.mass.value), page::number(result.run.mass.half_width(), 2));
  }
  if (std::abs(result.run.mass.value) < result.run.mass.half_width() && !result.true_mass) {
    return fmt::format("No load detected: {} kg ± {} kg (95 %).", page::number(result.run.mass.value, 2),
                       page::number(result.run.mass.half_width(), 2));
  }
  std::string text = fmt::format("The load weighs {} kg ± {} kg (95 %)", page::number(result.run.mass.value),
                                 page::number(result.run.mass.half_width(), 2));
  if (result.true_mass) text += fmt::format("; true {} kg", page::number(*result.true_mass));
  return text + ".";
}

std::string full(const Payload& result) {
  std::string text =
      fmt::format("{}: {} samples, torque of joints {} and up\n{}\n{}\n", result.log, result.run.samples,
                  result.run.first_joint, brief(result), verdict_text(result.judgement));
  text += estimate_table(result).to_text(2);
  if (!result.frame.empty()) text += fmt::format("In {}; inertia about its origin.\n", result.frame);
  text += result.run.converged_at ? fmt::format("Converged at {:.3g} s.\n", *result.run.converged_at)
                                  : "Not converged.\n";
  text += live_words(result) + "\n";
  for (const std::string& line : remarks(result)) text += line + '\n';
  for (const payload::LoadChange& change : result.run.changes) {
    text += std::isfinite(change.mass)
                ? fmt::format("Change at {:.3f} s: {} kg\n", change.time, page::number(change.mass))
                : fmt::format("Change at {:.3f} s: new mass not determined\n", change.time);
  }
  if (!result.run.torque_scale.empty()) {
    text += fmt::format("\n{}:\n{}", kScaleMeaning, scale_table(result).to_text(2));
  }
  if (result.before.rmse.size() > 0) {
    text += "\nTorque error per joint, without the load in the model and with it:\n" +
            torque_error_table(result).to_text(2);
    text += score_meaning(result.before) + '\n';
  }
  return text;
}

std::string json(const Payload& load) { return dumped(to_json(load)); }

std::string brief(const UnloadedArm& arm) {
  if (!arm.fit) return fmt::format("Model: {}.", arm.model_file_path);
  std::string names;
  for (const data::LogSource& log : arm.logs)
    names += fmt::format("{}{}", names.empty() ? "" : ", ", log.path);
  return fmt::format(
      "Model: recursive least squares over all joints of {}: {} of the {} combinations of parameters that any motion "
      "could determine; causal low-pass {:.3g} Hz.",
      names, arm.fit->determined, arm.fit->determinable, arm.fit->residual.cutoff);
}

std::string full(const UnloadedArm& arm) {
  return brief(arm) + "\n" + (arm.fit ? residual_table(arm.fit->residual).to_text(2) : "");
}

std::string brief(const payload::Weighing& found) {
  std::string text;
  for (const Payload& load : found.loads)
    text += fmt::format("{}{}: {}", text.empty() ? "" : "\n", load.log, brief(load));
  return text;
}

std::string full(const payload::Weighing& found) {
  std::string text = full(found.arm);
  for (const Payload& load : found.loads) text += '\n' + full(load);
  return text;
}

std::string json(const payload::Weighing& found) {
  if (found.loads.size() == 1) return json(found.loads.front());
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Payload& load : found.loads) list.push_back(to_json(load));
  return dumped(list);
}

page::Page page(const payload::Weighing& found) {
  const UnloadedArm& arm = found.arm;
  const std::vector<Payload>& loads = found.loads;
  std::vector<std::string> logs;
  for (const Payload& load : loads) logs.push_back(load.log);
  page::Page page = page::new_page(fmt::format("{}: the load at the flange", arm.robot.name),
                                   fmt::format("{}, torque of joints {} and up", file_names_of(logs),
                                               loads.empty() ? 1 : loads.front().run.first_joint));
  for (const Payload& load : loads) {
    if (loads.size() > 1) page.heading(file_name_of(load.log));
    add_log_line(page, {load.log, load.log_rate, load.log_seconds, load.run.cutoff});
    add_to(page, load);
    page.plots("Torque error over time", error_plots(load));
  }
  page.heading("Model of the arm without load");
  page.paragraph(brief(arm));
  if (arm.fit) page.table(residual_table(arm.fit->residual));
  return page;
}

}  // namespace heft::report
