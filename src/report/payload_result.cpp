#include "payload_result.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/statistics/distributions.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

constexpr std::array<const char*, 3> kComNames{"x", "y", "z"};
constexpr std::array<const char*, 6> kInertiaNames{"Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};

double half_width(const Estimate& estimate, Eigen::Index k) {
  return estimate.half_width.size() > k ? estimate.half_width[k] : statistics::kNormal95 * estimate.std[k];
}

Eigen::VectorXd half_widths(const Estimate& estimate) {
  Eigen::VectorXd widths(estimate.value.size());
  for (Eigen::Index k = 0; k < widths.size(); ++k) widths[k] = half_width(estimate, k);
  return widths;
}

/// What is not identifiable is null: a number there would be the prior's, not the data's.
Eigen::VectorXd told(const Estimate& estimate, Eigen::VectorXd values) {
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (!estimate.identifiable[static_cast<std::size_t>(k)])
      values[k] = std::numeric_limits<double>::quiet_NaN();
  }
  return values;
}

nlohmann::ordered_json estimate_json(const Estimate& estimate) {
  return {{"value", json_array(told(estimate, estimate.value))},
          {"std", json_array(told(estimate, estimate.std))},
          {"half_width_95", json_array(told(estimate, half_widths(estimate)))},
          {"identifiable", estimate.identifiable}};
}

Estimate withdrawn(Estimate estimate) {
  estimate.identifiable.assign(estimate.identifiable.size(), false);
  return estimate;
}

bool identifiable(const Estimate& estimate, Eigen::Index k) {
  return static_cast<std::size_t>(k) < estimate.identifiable.size() &&
         estimate.identifiable[static_cast<std::size_t>(k)];
}

void add_rows(page::Table& table, const std::string& what, const char* unit, const Estimate& estimate,
              const char* const* names) {
  for (Eigen::Index k = 0; k < estimate.value.size(); ++k) {
    const bool known = identifiable(estimate, k);
    table.add_row({names ? fmt::format("{} {}", what, names[k]) : what,
                   known ? page::number(estimate.value[k]) : "–",
                   known ? page::number(half_width(estimate, k), 2) : "–", unit,
                   known ? "" : "not identifiable from this motion"});
  }
}

page::Table estimate_table(const PayloadResult& result) {
  page::Table table({"", "value", "± 95 %", "unit", ""});
  add_rows(table, "mass", "kg", result.mass, nullptr);
  if (result.first_moment.value.size() > 0) {
    add_rows(table, "first moment", "kg·m", result.first_moment, kComNames.data());
  }
  add_rows(table, "centre of mass", "m", result.com, kComNames.data());
  add_rows(table, "inertia", "kg·m²", result.inertia, kInertiaNames.data());
  return table;
}

/// What each joint feels of the load; empty where that says nothing.
page::Table scale_table(const PayloadResult& result) {
  page::Table table({"joint", "torque scale", "± 95 %"});
  for (Eigen::Index j = 0; j < result.torque_scale.value.size(); ++j) {
    const bool known = identifiable(result.torque_scale, j);
    table.add_row({fmt::format("{}", j + 1), known ? page::number(result.torque_scale.value[j], 3) : "–",
                   known ? page::number(half_width(result.torque_scale, j), 2) : "–"});
  }
  return table;
}

constexpr const char* kScaleMeaning =
    "Torque that each joint feels of the load, in parts of what the load found would make it feel; 1 where "
    "the joints "
    "agree, – where a joint feels too little of it";

page::Table torque_error_table(const PayloadResult& result) {
  std::vector<std::string> headers{"joint", "RMSE before [N·m]"};
  if (result.rmse_after.size() > 0) {
    headers.insert(headers.end(), {"after", "change [%]"});
    if (result.rmse_after_friction.size() > 0) headers.push_back("and friction as found");
  }
  if (result.rmse_in_band_before.size() > 0) headers.push_back("in band before");
  if (result.rmse_in_band_after.size() > 0) headers.push_back("in band after");
  page::Table table(headers);
  for (Eigen::Index j = 0; j < result.rmse_before.size(); ++j) {
    std::vector<std::string> row{fmt::format("{}", j + 1), page::number(result.rmse_before[j])};
    if (result.rmse_after.size() > 0) {
      row.push_back(page::number(result.rmse_after[j]));
      row.push_back(fmt::format("{:+.0f}", 100.0 * (result.rmse_after[j] / result.rmse_before[j] - 1.0)));
      if (result.rmse_after_friction.size() > 0) row.push_back(page::number(result.rmse_after_friction[j]));
    }
    if (result.rmse_in_band_before.size() > 0) row.push_back(page::number(result.rmse_in_band_before[j]));
    if (result.rmse_in_band_after.size() > 0) row.push_back(page::number(result.rmse_in_band_after[j]));
    table.add_row(row);
  }
  return table;
}

/// Where the interval comes from, and what it leaves out.
std::vector<std::string> remarks(const PayloadResult& result) {
  std::vector<std::string> lines;
  if (!result.missing.empty()) lines.push_back(fmt::format("Not told: {}.", result.missing));
  if (identifiable(result.mass, 0) && !result.mass_std_parts.empty()) {
    std::string parts;
    for (const StdPart& part : result.mass_std_parts) {
      parts += fmt::format("{}{} {}", parts.empty() ? "" : ", ", part.source, page::number(part.std, 2));
    }
    lines.push_back(fmt::format(
        "Standard deviation of the mass [kg]: {}; from {} blocks of {:.3g} s, since the residual is "
        "correlated in time.",
        parts, result.blocks, result.block_length));
    if (!result.has_model_covariance) {
      lines.push_back(
          "The model file holds no covariance, so the interval leaves the model's own error out.");
    }
    lines.push_back(
        "The interval holds for the torque scale given: torque constants that are 2 % off move the mass by 2 "
        "%.");
  }
  for (const ZeroCheck& check : result.zero_checks) {
    lines.push_back(fmt::format("Zero check, {}: {} ± {} kg where there is no load.", check.log,
                                page::number(check.mass, 2), page::number(check.half_width, 2)));
  }
  if (identifiable(result.mass, 0) && result.zero_checks.empty() && !result.mass_std_parts.empty()) {
    lines.push_back(
        "No zero check: what the model gets wrong from one day to the next is not in the interval (--zero "
        "gives it a "
        "log without load).");
  }
  lines.insert(lines.end(), result.notes.begin(), result.notes.end());
  return lines;
}

/// Range of the mass plot: that of the values told after the first tenth of the run, so that the wild
/// values at the start do not press the rest flat.
std::pair<double, double> settled_range(const PayloadResult& result) {
  double low = std::min(0.0, result.true_mass.value_or(0.0));
  double high = std::max(0.0, result.true_mass.value_or(0.0));
  for (Eigen::Index k = result.time.size() / 10; k < result.time.size(); ++k) {
    if (!std::isfinite(result.mass_history[k])) continue;
    if (result.mass_std_history.size() == result.time.size() && !std::isfinite(result.mass_std_history[k]))
      continue;
    low = std::min(low, result.mass_history[k]);
    high = std::max(high, result.mass_history[k]);
  }
  if (!(high > low)) high = low + 1.0;
  const double margin = 0.15 * (high - low);
  return {low - margin, high + margin};
}

}  // namespace

nlohmann::ordered_json to_json(const PayloadResult& result) {
  nlohmann::ordered_json json{{"robot", result.robot}, {"log", result.log}};
  put_verdict(json, result.judgement);
  // What contradicts itself is no number to go on with.
  const bool has_mass =
      result.mass.value.size() > 0 && identifiable(result.mass, 0) && !result.contradicts_itself;
  json["mass"] = {
      {"value", has_mass ? host::number_or_null(result.mass.value[0]) : nlohmann::ordered_json(nullptr)},
      {"std", has_mass ? host::number_or_null(result.mass.std[0]) : nlohmann::ordered_json(nullptr)},
      {"half_width_95",
       has_mass ? host::number_or_null(half_width(result.mass, 0)) : nlohmann::ordered_json(nullptr)},
      {"identifiable", has_mass}};
  if (result.first_moment.value.size() > 0) {
    json["first_moment"] =
        estimate_json(result.contradicts_itself ? withdrawn(result.first_moment) : result.first_moment);
  }
  json["com"] = estimate_json(result.contradicts_itself ? withdrawn(result.com) : result.com);
  json["inertia"] = estimate_json(result.contradicts_itself ? withdrawn(result.inertia) : result.inertia);
  if (result.torque_scale.value.size() > 0) json["torque_scale"] = estimate_json(result.torque_scale);
  json["inertia"]["order"] = kInertiaNames;
  json["rows"] = result.rows;
  json["samples"] = result.samples;
  json["converged_at"] =
      result.converged_at ? nlohmann::ordered_json(*result.converged_at) : nlohmann::ordered_json(nullptr);
  json["changes"] = nlohmann::ordered_json::array();
  for (const MassChange& change : result.changes) {
    nlohmann::ordered_json entry{{"time", change.time}, {"mass", host::number_or_null(change.mass)}};
    if (std::isfinite(change.std)) entry["std"] = change.std;
    if (std::isfinite(change.mass_before)) entry["mass_before"] = change.mass_before;
    json["changes"].push_back(std::move(entry));
  }
  if (result.rmse_before.size() > 0) {
    json["rmse_before"] = json_array(result.rmse_before);
    if (result.rmse_after.size() > 0) json["rmse_after"] = json_array(result.rmse_after);
    if (result.rmse_after_friction.size() > 0)
      json["rmse_after_with_friction"] = json_array(result.rmse_after_friction);
  }
  if (result.rmse_in_band_before.size() > 0) {
    json["rmse_in_band_before"] = json_array(result.rmse_in_band_before);
    if (result.rmse_in_band_after.size() > 0)
      json["rmse_in_band_after"] = json_array(result.rmse_in_band_after);
    json["band_hz"] = result.band > 0 ? nlohmann::ordered_json(result.band) : nlohmann::ordered_json(nullptr);
  }
  if (!result.frame.empty()) json["frame"] = result.frame;
  if (!result.missing.empty()) json["missing"] = result.missing;
  if (result.cutoff > 0) json["cutoff_hz"] = result.cutoff;
  if (!result.zero_checks.empty()) {
    json["zero_checks"] = nlohmann::ordered_json::array();
    for (const ZeroCheck& check : result.zero_checks) {
      json["zero_checks"].push_back({{"log", check.log}, {"mass", check.mass}, {"std", check.std}});
    }
  }
  return json;
}

std::string verdict_of(const PayloadResult& result) {
  if (!identifiable(result.mass, 0)) return "The mass of the load cannot be determined from this motion.";
  if (result.contradicts_itself) {
    return fmt::format("No load can be what this log says: {} kg ± {} kg (95 %).",
                       page::number(result.mass.value[0]), page::number(half_width(result.mass, 0), 2));
  }
  if (std::abs(result.mass.value[0]) < half_width(result.mass, 0) && !result.true_mass) {
    return fmt::format("No load to be seen: {} kg ± {} kg (95 %).", page::number(result.mass.value[0], 2),
                       page::number(half_width(result.mass, 0), 2));
  }
  std::string text = fmt::format("The load weighs {} kg ± {} kg (95 %)", page::number(result.mass.value[0]),
                                 page::number(half_width(result.mass, 0), 2));
  if (result.true_mass) text += fmt::format("; true {} kg", page::number(*result.true_mass));
  return text + ".";
}

std::string to_text(const PayloadResult& result) {
  std::string text =
      fmt::format("{}: {} samples, torque of joints {} and up\n{}\n{}\n", result.log, result.samples,
                  result.rows, verdict_of(result), verdict_text(result.judgement));
  text += estimate_table(result).to_text(2);
  if (!result.frame.empty()) text += fmt::format("In {}; inertia about its origin.\n", result.frame);
  text += result.converged_at ? fmt::format("Converged at {:.3g} s.\n", *result.converged_at)
                              : "Not converged.\n";
  for (const std::string& line : remarks(result)) text += line + '\n';
  for (const MassChange& change : result.changes) {
    text += std::isfinite(change.mass)
                ? fmt::format("Change at {:.3f} s: {} kg\n", change.time, page::number(change.mass))
                : fmt::format("Change at {:.3f} s: new mass not told\n", change.time);
  }
  if (result.torque_scale.value.size() > 0) {
    text += fmt::format("\n{}:\n{}", kScaleMeaning, scale_table(result).to_text(2));
  }
  if (result.rmse_before.size() > 0) {
    text += "\nTorque error per joint, without the load in the model and with it:\n" +
            torque_error_table(result).to_text(2);
    if (!result.rmse_meaning.empty()) text += result.rmse_meaning + '\n';
  }
  return text;
}

void add_to(page::Page& page, const PayloadResult& result) {
  page.verdict(verdict_of(result), result.judgement);
  std::vector<page::Fact> facts;
  if (identifiable(result.mass, 0)) {
    facts.push_back({"mass", page::number(result.mass.value[0]) + " kg",
                     "± " + page::number(half_width(result.mass, 0), 2) + " kg (95 %)"});
  }
  facts.push_back(
      {"converged at", result.converged_at ? fmt::format("{:.3g} s", *result.converged_at) : "–", ""});
  facts.push_back(
      {"samples", fmt::format("{}", result.samples), fmt::format("torque of joints {} and up", result.rows)});
  page.facts(facts);
  if (result.time.size() > 0) {
    page::PlotSpec spec;
    spec.title = "Mass of the load";
    spec.x_label = "time [s]";
    spec.y_label = "mass [kg]";
    if (result.mass_std_history.size() == result.time.size()) {
      const Eigen::VectorXd half = statistics::kNormal95 * result.mass_std_history;
      spec.series.push_back(page::band("95 % interval", result.time, result.mass_history - half,
                                       result.mass_history + half, page::Hue::kBlue));
    }
    spec.series.push_back(page::line("estimate", result.time, result.mass_history, page::Hue::kBlue));
    for (const MassChange& change : result.changes) {
      spec.marks.push_back({page::Mark::Direction::kVertical, change.time, "change"});
    }
    if (result.true_mass) {
      spec.marks.push_back({page::Mark::Direction::kHorizontal, *result.true_mass,
                            fmt::format("true {} kg", page::number(*result.true_mass))});
    }
    spec.y_range = settled_range(result);
    page.plot(spec);
  }
  page.table(estimate_table(result), fmt::format("The load in {}; inertia about its origin",
                                                 result.frame.empty() ? "the flange frame" : result.frame));
  for (const std::string& line : remarks(result)) page.note(line);
  if (result.torque_scale.value.size() > 0) page.table(scale_table(result), kScaleMeaning);
  if (result.rmse_before.size() > 0) {
    page::PlotSpec spec;
    spec.title = "Torque error per joint";
    spec.y_label = "RMSE [N·m]";
    spec.series = {page::bars("without the load", to_vector(result.rmse_before), page::Hue::kNeutral)};
    if (result.rmse_after.size() > 0) {
      spec.series.push_back(
          page::bars("with the load found", to_vector(result.rmse_after), page::Hue::kBlue));
    }
    spec.categories = joint_names(result.rmse_before.size());
    page.plot(spec);
    page.table(torque_error_table(result), result.rmse_meaning);
  }
}

}  // namespace heft::report
