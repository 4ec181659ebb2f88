#include "diagnosis_result.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

/// Change for a column of numbers under "[%]".
std::string percent_cell(double before, double after) {
  if (!(before > 0.0) || !std::isfinite(after)) return "–";
  const double percent = 100.0 * (after / before - 1.0);
  return std::abs(percent) < 0.05 ? "0" : fmt::format("{:.{}f}", percent, std::abs(percent) < 10.0 ? 1 : 0);
}

std::string p_in_words(double p) {
  if (!std::isfinite(p)) return "–";
  return p < 1e-300 ? "< 1e-300" : p < 1e-3 ? fmt::format("{:.0e}", p) : number(p, 2);
}

std::string list_of(const std::vector<std::string>& parts) {
  if (parts.size() < 2) return parts.empty() ? "" : parts.front();
  const std::vector<std::string> first(parts.begin(), parts.end() - 1);
  return fmt::format("{} and {}", fmt::join(first, ", "), parts.back());
}

/// What it is worth on the validation logs.
std::string worth(const std::string& whose, double before, double after, const std::string& unit,
                  std::size_t logs) {
  const std::string where = logs > 1 ? "the validation logs" : "the validation log";
  if (!(before > 0.0) || !std::isfinite(after)) return "";
  constexpr double kNoChange = 0.005;
  if (std::abs(after / before - 1.0) < kNoChange) {
    return fmt::format("{} error on {} stays at {} {}", whose, where, number(before, 3), unit);
  }
  return fmt::format("adding it {} {} error on {} from {} to {} {} ({})", after < before ? "cuts" : "raises",
                     whose, where, number(before, 3), number(after, 3), unit, change_percent(before, after));
}

std::string unexplained_in_words(const diagnose::Unexplained& unexplained) {
  return unexplained.joint < 0 ? unexplained.what
                               : fmt::format("joint {}, {}", unexplained.joint + 1, unexplained.what);
}

/// One in full, several by their joints.
std::string unexplained_in_words(const std::vector<diagnose::Unexplained>& unexplained) {
  if (unexplained.size() == 1) return unexplained_in_words(unexplained.front());
  std::set<int> joints;
  for (const diagnose::Unexplained& u : unexplained) joints.insert(u.joint);
  std::vector<std::string> numbers;
  for (const int j : joints) {
    if (j >= 0) numbers.push_back(fmt::format("{}", j + 1));
  }
  if (numbers.empty()) return unexplained.empty() ? "" : "of the whole arm";
  return fmt::format("in joint{} {}", numbers.size() > 1 ? "s" : "", list_of(numbers));
}

std::vector<std::string> names_of(const std::vector<diagnose::Rival>& rivals) {
  std::vector<std::string> names;
  for (const diagnose::Rival& rival : rivals) names.push_back(effect_in_place(rival.effect, rival.joint));
  return names;
}

/// "joint 2", "joints 1, 3 and 5" of joints counted from 0.
std::string joints_in_words(const std::set<int>& joints) {
  std::vector<std::string> numbers;
  for (const int joint : joints) numbers.push_back(fmt::format("{}", joint + 1));
  return fmt::format("joint{} {}", numbers.size() > 1 ? "s" : "", list_of(numbers));
}

/// "presliding (friction hysteresis) in joints 1, 3 and 5", one entry a kind, the one with the strongest effect first.
std::vector<std::string> kinds_in_place(const std::vector<Finding>& findings) {
  std::vector<EffectKind> kinds;
  std::vector<std::set<int>> joints;
  for (const Finding& finding : findings) {
    const auto at = std::find(kinds.begin(), kinds.end(), finding.effect);
    const auto place = static_cast<std::size_t>(at - kinds.begin());
    if (at == kinds.end()) {
      kinds.push_back(finding.effect);
      joints.emplace_back();
    }
    if (finding.joint >= 0) joints[place].insert(finding.joint);
  }
  std::vector<std::string> words;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    words.push_back(effect_name(kinds[k]) + (joints[k].empty() ? "" : " in " + joints_in_words(joints[k])));
  }
  return words;
}

bool has_scores(const validate::Score& before, const validate::Score& after) {
  return before.rmse.size() > 0 && before.rmse.size() == after.rmse.size();
}

/// Fall of a joint's error on the validation logs, as a share.
struct Fall {
  int joint;
  double share;
};
/// Share from which the sentence at the top names a joint besides the main one.
constexpr double kMuch = 0.2;

/// All joints, the largest fall first.
std::vector<Fall> falls(const Diagnosis& diagnosis) {
  std::vector<Fall> all;
  const validate::Score &before = diagnosis.validate_before, &after = diagnosis.validate_after;
  if (!has_scores(before, after)) return all;
  for (Eigen::Index j = 0; j < before.rmse.size(); ++j) {
    if (before.rmse[j] > 0.0) all.push_back({static_cast<int>(j), 1.0 - after.rmse[j] / before.rmse[j]});
  }
  std::stable_sort(all.begin(), all.end(), [](const Fall& a, const Fall& b) { return a.share > b.share; });
  return all;
}

/// "joint 2 (0.43 → 0.29 N·m, −33 %)".
std::string fall_in_words(const Diagnosis& diagnosis, int joint) {
  const double before = diagnosis.validate_before.rmse[joint], after = diagnosis.validate_after.rmse[joint];
  return fmt::format("joint {} ({} → {} {}, {})", joint + 1, number(before, 3), number(after, 3),
                     torque_unit(diagnosis.after, joint), change_percent(before, after));
}

nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json joint_or_null(int joint) {
  return joint < 0 ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(joint + 1);
}

nlohmann::ordered_json before_after_json(const validate::Score& before, const validate::Score& after) {
  nlohmann::ordered_json json;
  json["rmse_before"] = json_array(before.rmse);
  json["rmse_after"] = json_array(after.rmse);
  json["rmse_in_band_before"] = json_array(before.rmse_in_band);
  json["rmse_in_band_after"] = json_array(after.rmse_in_band);
  json["r2_before"] = json_array(before.r2);
  json["r2_after"] = json_array(after.r2);
  json["rmse_percent_of_max_before"] = json_array(before.percent_of_max);
  json["rmse_percent_of_max_after"] = json_array(after.percent_of_max);
  json["samples"] = after.samples;
  return json;
}

/// Error of all joints against their torque, 100 ‖τ - τ̂‖ / ‖τ‖ [%].
double relative_error(const Eigen::VectorXd& error, const Eigen::VectorXd& torque) {
  return 100.0 * error.norm() / torque.norm();
}

/// Before and after, in band: of all samples, and of the motion alone.
struct RelativeErrors {
  double before, after, moving_before, moving_after;
};

RelativeErrors relative_errors(const Diagnosis& d) {
  const validate::Score &before = d.validate_before, &after = d.validate_after, &torque = d.validate_torque;
  return {relative_error(before.rmse_in_band, torque.rmse_in_band),
          relative_error(after.rmse_in_band, torque.rmse_in_band),
          relative_error(before.rmse_in_band_moving, torque.rmse_in_band_moving),
          relative_error(after.rmse_in_band_moving, torque.rmse_in_band_moving)};
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
    if (with_score) entry["delta_bic"] = number_or_null(rival.delta_bic);
    json.push_back(std::move(entry));
  }
  return json;
}

nlohmann::ordered_json parameters_json(const Finding& finding) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const auto& [name, value] : finding.parameters) json[name] = number_or_null(value);
  // Components of one vector stand as one.
  if (json.contains("com_x") && json.contains("com_y") && json.contains("com_z")) {
    json["com"] = {json["com_x"], json["com_y"], json["com_z"]};
    for (const char* part : {"com_x", "com_y", "com_z"}) json.erase(part);
  }
  for (const auto& [name, value] : finding.words) json[name] = value;
  if (!finding.events.empty()) {
    json["events"] = nlohmann::ordered_json::array();
    for (std::size_t k = 0; k < finding.events.size(); ++k) {
      nlohmann::ordered_json event{{"t0", finding.events[k].first}, {"duration", finding.events[k].second}};
      if (k < finding.forces.size()) event["force"] = json_array(finding.forces[k]);
      json["events"].push_back(std::move(event));
    }
  }
  return json;
}

nlohmann::ordered_json effect_json(const Finding& finding) {
  nlohmann::ordered_json json{{"kind", finding.effect.id()},
                              {"joint", joint_or_null(finding.joint)},
                              {"name", effect_name(finding.effect)},
                              {"parameters", parameters_json(finding)},
                              {"p_value", number_or_null(finding.p_value)},
                              {"delta_bic", number_or_null(finding.delta_bic)},
                              {"cross_validated_fall", number_or_null(finding.cross_validated)},
                              {"main_joint", finding.main_joint + 1},
                              {"validate_rmse_before", number_or_null(finding.validate_before)},
                              {"validate_rmse_after", number_or_null(finding.validate_after)},
                              {"rivals", rivals_json(finding.rivals, true)},
                              {"equivalent", rivals_json(finding.equivalent, false)},
                              {"shown_by", shown_by(finding)}};
  if (finding.driven_joint >= 0) json["driven_joint"] = finding.driven_joint + 1;
  if (finding.displacement != Displacement::kPosition)
    json["displacement"] = displacement_name(finding.displacement);
  return json;
}

/// Refusals, those that would explain most first.
std::vector<diagnose::Refusal> strongest(const Diagnosis& diagnosis) {
  std::vector<diagnose::Refusal> refusals = diagnosis.refusals;
  std::stable_sort(refusals.begin(), refusals.end(),
                   [](const diagnose::Refusal& a, const diagnose::Refusal& b) { return a.gain > b.gain; });
  return refusals;
}

}  // namespace

std::string capital(std::string text) {
  if (!text.empty() && text.front() >= 'a' && text.front() <= 'z') text.front() += 'A' - 'a';
  return text;
}

std::string finding_in_place(const Diagnosis& diagnosis, const Finding& finding) {
  const auto same = std::count_if(
      diagnosis.findings.begin(), diagnosis.findings.end(),
      [&](const Finding& other) { return other.effect == finding.effect && other.joint == finding.joint; });
  const bool one_of_two = same > 1 && joint_effect_has_memory(finding.effect.joint_effect());
  return effect_in_place(finding.effect, finding.joint) + (one_of_two ? ", one of two distances" : "");
}

std::vector<const Finding*> by_kind(const Diagnosis& diagnosis) {
  std::vector<const Finding*> order;
  std::vector<EffectKind> kinds;
  for (const Finding& finding : diagnosis.findings) {
    order.push_back(&finding);
    if (std::find(kinds.begin(), kinds.end(), finding.effect) == kinds.end()) kinds.push_back(finding.effect);
  }
  const auto place = [&](const Finding* f) {
    return std::find(kinds.begin(), kinds.end(), f->effect) - kinds.begin();
  };
  std::stable_sort(order.begin(), order.end(), [&](const Finding* a, const Finding* b) {
    return place(a) != place(b) ? place(a) < place(b) : a->joint < b->joint;
  });
  return order;
}

std::string evidence_in_words(const Finding& finding) {
  return fmt::format("p {}, ΔBIC {}, error on blocks not fitted {}", p_in_words(finding.p_value),
                     minus(fmt::format("{:.0f}", finding.delta_bic)),
                     change_percent(1.0, 1.0 - finding.cross_validated));
}

std::string evidence_in_words(const diagnose::Unexplained& unexplained) {
  constexpr std::string_view kShare = "share: ";
  std::vector<std::string> parts, shares;
  for (const auto& [name, value] : unexplained.evidence) {
    // What is left above noise and at which frequency stands in the words already.
    if (name == "share_above_noise" || (name == "frequency_hz" && !shares.empty())) continue;
    if (name.starts_with(kShare)) {
      shares.push_back(fmt::format("{} {} %", name.substr(kShare.size()), short_number(100.0 * value, 2)));
    } else {
      parts.push_back(fmt::format("{} {}", name == "noise_rms" ? "noise" : name, short_number(value, 3)));
    }
  }
  std::string text = fmt::format("{}", fmt::join(parts, ", "));
  if (!shares.empty()) text += fmt::format("{}shares: {}", text.empty() ? "" : "; ", fmt::join(shares, "; "));
  return text;
}

std::string relative_error_in_words(const Diagnosis& diagnosis) {
  const RelativeErrors relative = relative_errors(diagnosis);
  std::string text = fmt::format("All joints together, in band: error {} → {} % of the torque",
                                 number(relative.before, 3), number(relative.after, 3));
  if (std::isfinite(relative.moving_after)) {
    text += fmt::format("; without standstill at the ends {} → {} %", number(relative.moving_before, 3),
                        number(relative.moving_after, 3));
  }
  return text + ".";
}

std::string rivals_in_words(const std::vector<diagnose::Rival>& rivals, bool with_score) {
  std::vector<std::string> parts;
  for (const diagnose::Rival& rival : rivals) {
    parts.push_back(
        effect_in_place(rival.effect, rival.joint) +
        (with_score ? fmt::format(" (ΔBIC {})", minus(fmt::format("{:.0f}", rival.delta_bic))) : ""));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

std::string change_percent(double before, double after) {
  if (!(before > 0.0) || !std::isfinite(after)) return "–";
  const double percent = 100.0 * (after / before - 1.0);
  if (std::abs(percent) < 0.05) return "0 %";
  return fmt::format("{}{:.{}f} %", percent < 0.0 ? "−" : "+", std::abs(percent),
                     std::abs(percent) < 10.0 ? 1 : 0);
}

std::string torque_unit(const model::Robot& robot, int joint) {
  return is_prismatic(robot, joint) ? "N" : "N·m";
}

std::string torque_unit(const model::Robot& robot) {
  bool turns = false, slides = false;
  for (int j = 0; j < robot.num_joints(); ++j) (is_prismatic(robot, j) ? slides : turns) = true;
  return turns && slides ? "N·m, N" : slides ? "N" : "N·m";
}

std::string diagnosis_verdict(const Diagnosis& diagnosis) {
  const std::size_t logs = std::max<std::size_t>(1, diagnosis.validate_each_after.size());
  const std::string left = unexplained_in_words(diagnosis.unexplained);
  if (!diagnosis.not_explained.empty()) {
    // Before anything else: what the small effects are worth is of no interest while a joint is wrong.
    std::string text;
    for (const diagnose::NotExplained& joint : diagnosis.not_explained)
      text += (text.empty() ? "" : " ") + capital(diagnose::in_words(joint, diagnosis.after)) + ".";
    Diagnosis others = diagnosis;
    others.not_explained.clear();
    return others.findings.empty() ? text : text + " In the other joints: " + diagnosis_verdict(others);
  }
  if (diagnosis.findings.empty()) {
    if (!left.empty()) return fmt::format("An unexplained residual remains: {}.", left);
    return "Nothing is missing: rigid bodies with Coulomb and viscous friction explain these logs, and no "
           "further effect lowers the error on data not fitted by more than chance and by enough to matter.";
  }
  std::string text;
  if (diagnosis.findings.size() == 1) {
    const Finding& finding = diagnosis.findings.front();
    text = matter(finding);
    const std::string whose =
        finding.joint == finding.main_joint ? "its" : fmt::format("joint {}'s", finding.main_joint + 1);
    const std::string value = worth(whose, finding.validate_before, finding.validate_after,
                                    torque_unit(diagnosis.after, finding.main_joint), logs);
    text += value.empty() ? "" : ": " + value;
    // What else it does falls to it alone.
    std::vector<std::string> others;
    for (const Fall& fall : falls(diagnosis)) {
      if (fall.joint != finding.main_joint && others.size() < 2 && fall.share > kMuch)
        others.push_back(fall_in_words(diagnosis, fall.joint));
    }
    if (!value.empty() && !others.empty()) text += fmt::format(", and that of {}", list_of(others));
    text += ".";
    if (!finding.equivalent.empty()) {
      text +=
          fmt::format(" This motion cannot distinguish it from {}.", list_of(names_of(finding.equivalent)));
    }
  } else {
    constexpr std::size_t kMostNames = 3, kMostJoints = 2;
    std::vector<std::string> effects = kinds_in_place(diagnosis.findings), joints;
    const bool some = effects.size() > kMostNames;
    if (some) effects.resize(kMostNames);
    text = fmt::format("{} effects are missing{}{}", diagnosis.findings.size(),
                       some ? ", the strongest " : ": ", list_of(effects));
    for (const Fall& fall : falls(diagnosis)) {
      if (fall.share > 0.0 && joints.size() < kMostJoints)
        joints.push_back(fall_in_words(diagnosis, fall.joint));
    }
    if (!joints.empty()) {
      text += fmt::format(". With all of them the error on the validation log{} falls most in {}",
                          logs > 1 ? "s" : "", list_of(joints));
    }
    text += ".";
  }
  if (!left.empty()) text += fmt::format(" Beyond that an unexplained residual remains: {}.", left);
  return text;
}

std::vector<std::string> diagnosis_notes(const Diagnosis& diagnosis) {
  std::vector<std::string> notes{diagnosis_verdict(diagnosis)};
  for (const Finding& finding : diagnosis.findings) {
    notes.push_back(fmt::format("{}: {}; {}", finding_in_place(diagnosis, finding),
                                parameters_in_words(finding, diagnosis.after), evidence_in_words(finding)));
  }
  notes.insert(notes.end(), diagnosis.notes.begin(), diagnosis.notes.end());
  return notes;
}

int most_improved_joint(const Diagnosis& diagnosis) {
  const std::vector<Fall> all = falls(diagnosis);
  return all.empty() ? -1 : all.front().joint;
}

std::vector<std::string> errors_that_rise(const Diagnosis& diagnosis) {
  constexpr double kRise = 1.01;
  std::vector<std::string> lines;
  const std::size_t logs =
      std::min(diagnosis.validate_each_before.size(), diagnosis.validate_each_after.size());
  for (std::size_t k = 0; k < logs; ++k) {
    const validate::Score &before = diagnosis.validate_each_before[k],
                          &after = diagnosis.validate_each_after[k];
    if (!has_scores(before, after)) continue;
    for (Eigen::Index j = 0; j < before.rmse.size(); ++j) {
      if (after.rmse[j] <= kRise * before.rmse[j]) continue;
      lines.push_back(fmt::format("{}: the error of joint {} rises from {} to {} {} ({})", before.log, j + 1,
                                  number(before.rmse[j], 3), number(after.rmse[j], 3),
                                  torque_unit(diagnosis.after, static_cast<int>(j)),
                                  change_percent(before.rmse[j], after.rmse[j])));
    }
  }
  return lines;
}

page::Table before_after_table(const validate::Score& before, const validate::Score& after,
                               const model::Robot& robot) {
  const std::string unit = torque_unit(robot);
  page::Table table({"joint", fmt::format("RMSE before [{}]", unit), "after", "change [%]",
                     fmt::format("in band before [{}]", unit), "after", "change [%]", "R² before", "after"});
  if (!has_scores(before, after)) return table;
  const auto r2 = [](double value) { return std::isfinite(value) ? fmt::format("{:.4f}", value) : "–"; };
  for (Eigen::Index j = 0; j < before.rmse.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), number(before.rmse[j], 3), number(after.rmse[j], 3),
                   percent_cell(before.rmse[j], after.rmse[j]), number(before.rmse_in_band[j], 3),
                   number(after.rmse_in_band[j], 3),
                   percent_cell(before.rmse_in_band[j], after.rmse_in_band[j]), r2(before.r2[j]),
                   r2(after.r2[j])});
  }
  return table;
}

page::Table ranking_table(const Diagnosis& diagnosis, const model::Robot& robot) {
  page::Table table(
      {"", "effect", "joint", "p", "ΔBIC", "blocks not fitted [%]", "validation RMSE", "change [%]"});
  const auto joint = [](int j) { return j < 0 ? std::string("–") : fmt::format("{}", j + 1); };
  int rank = 0;
  for (const Finding* effect : by_kind(diagnosis)) {
    const Finding& finding = *effect;
    const std::string unit = torque_unit(robot, finding.main_joint);
    const bool judged = finding.validate_before > 0.0;
    table.add_row(
        {fmt::format("{}", ++rank), std::string(finding.effect.id()), joint(finding.joint),
         p_in_words(finding.p_value), fmt::format("{:.0f}", finding.delta_bic),
         percent_cell(1.0, 1.0 - finding.cross_validated),
         judged ? fmt::format("joint\u00a0{}: {}\u00a0→\u00a0{}\u00a0{}", finding.main_joint + 1,
                              number(finding.validate_before, 3), number(finding.validate_after, 3), unit)
                : "–",
         percent_cell(finding.validate_before, finding.validate_after)});
    for (const diagnose::Rival& rival : finding.equivalent) {
      table.add_row({"", "= " + std::string(rival.effect.id()), joint(rival.joint), "", "", "",
                     "the same in this motion"});
    }
    for (const diagnose::Rival& rival : finding.rivals) {
      table.add_row({"", "or " + std::string(rival.effect.id()), joint(rival.joint), "",
                     fmt::format("{:.0f}", rival.delta_bic), "", "rival"});
    }
  }
  return table;
}

page::Table refusal_table(const Diagnosis& diagnosis, std::size_t most) {
  page::Table table({"effect", "joint", "would explain", "refused because"});
  for (const diagnose::Refusal& refusal : strongest(diagnosis)) {
    if (table.rows().size() == most) break;
    table.add_row({std::string(refusal.effect.id()),
                   refusal.joint < 0 ? "–" : fmt::format("{}", refusal.joint + 1),
                   fmt::format("{} %", number(100.0 * refusal.gain, 2)), refusal.why});
  }
  return table;
}

host::Judgement judgement_of(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  host::Judgement judgement = diagnosis.judgement();
  judgement.add(context.torque);
  return judgement;
}

std::string diagnosis_text(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  constexpr std::size_t kMostRefusals = 5;
  const model::Robot& robot = diagnosis.after;
  std::string text = diagnosis_verdict(diagnosis) + "\n" + verdict_text(judgement_of(diagnosis, context));
  int rank = 0;
  for (const Finding* effect : by_kind(diagnosis)) {
    const Finding& finding = *effect;
    text += fmt::format("\n{}. {}\n", ++rank, capital(finding_in_place(diagnosis, finding)));
    const auto line = [&](const char* label, const std::string& content) {
      if (!content.empty()) text += fmt::format("   {:<12}{}\n", label, content);
    };
    line("kind", std::string(finding.effect.id()));
    line("term", effect_equation(finding));
    line("parameters", parameters_in_words(finding, robot));
    line("evidence", evidence_in_words(finding));
    line("validation",
         finding.validate_before > 0.0
             ? fmt::format("joint {}: {} → {} {} ({})", finding.main_joint + 1,
                           number(finding.validate_before, 3), number(finding.validate_after, 3),
                           torque_unit(robot, finding.main_joint),
                           change_percent(finding.validate_before, finding.validate_after))
             : "");
    line("rivals", rivals_in_words(finding.rivals, true));
    line("the same as", rivals_in_words(finding.equivalent, false));
    if (!finding.rivals.empty() || !finding.equivalent.empty()) line("distinguish", "by " + shown_by(finding));
  }
  const auto scores = [&](const char* title, const validate::Score& before, const validate::Score& after) {
    if (!has_scores(before, after)) return;
    text += fmt::format("\n{}\n{}", title, before_after_table(before, after, robot).to_text(2));
  };
  scores("Validation, not seen by the fit", diagnosis.validate_before, diagnosis.validate_after);
  scores("Training", diagnosis.train_before, diagnosis.train_after);
  if (has_scores(diagnosis.validate_before, diagnosis.validate_after)) {
    if (diagnosis.validate_torque.rmse_in_band.size() > 0) text += relative_error_in_words(diagnosis) + "\n";
    text += fmt::format(
        "{} Before: rigid bodies, Coulomb and viscous friction; after: with the effects. Positions through a "
        "low-pass of {:.3g} Hz.\n",
        score_meaning(diagnosis.validate_after), diagnosis.cutoff);
  }
  if (diagnosis.validate_each_after.size() > 1) {
    const std::size_t count =
        std::min(diagnosis.validate_each_before.size(), diagnosis.validate_each_after.size());
    for (std::size_t k = 0; k < count; ++k) {
      scores(diagnosis.validate_each_after[k].log.c_str(), diagnosis.validate_each_before[k],
             diagnosis.validate_each_after[k]);
    }
  }
  for (const std::string& line : errors_that_rise(diagnosis)) text += "Worse: " + line + "\n";
  if (!diagnosis.refusals.empty()) {
    text += fmt::format("\nRefused{}\n{}",
                        diagnosis.refusals.size() > kMostRefusals
                            ? fmt::format(", the {} largest of {}", kMostRefusals, diagnosis.refusals.size())
                            : "",
                        refusal_table(diagnosis, kMostRefusals).to_text(2));
  }
  text += "\nUnexplained\n";
  if (diagnosis.unexplained.empty()) text += "  nothing above noise\n";
  for (const diagnose::Unexplained& u : diagnosis.unexplained) {
    const std::string evidence = evidence_in_words(u);
    text += fmt::format("  {}{}\n", unexplained_in_words(u), evidence.empty() ? "" : " (" + evidence + ")");
  }
  for (const std::string& line : diagnosis.notes) text += "Note: " + line + "\n";
  text += fmt::format("\n{} candidates tried on {:.1f} s of training motion. Again:\n  {}\n",
                      diagnosis.candidates, diagnosis.seconds, context.command);
  return text;
}

nlohmann::ordered_json diagnosis_json(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  nlohmann::ordered_json json;
  json["robot"] = diagnosis.after.name;
  put_verdict(json, judgement_of(diagnosis, context));
  json["summary"] = diagnosis_verdict(diagnosis);
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
  json["train"] = before_after_json(diagnosis.train_before, diagnosis.train_after);
  json["validate"] = before_after_json(diagnosis.validate_before, diagnosis.validate_after);
  if (diagnosis.validate_torque.rmse_in_band.size() > 0) {
    const RelativeErrors relative = relative_errors(diagnosis);
    nlohmann::ordered_json& validate = json["validate"];
    validate["r2_in_band_before"] =
        json_array(r2_in_band(diagnosis.validate_before, diagnosis.validate_torque));
    validate["r2_in_band_after"] =
        json_array(r2_in_band(diagnosis.validate_after, diagnosis.validate_torque));
    validate["relative_error_in_band_before"] = number_or_null(relative.before);
    validate["relative_error_in_band_after"] = number_or_null(relative.after);
    validate["relative_error_in_band_moving_before"] = number_or_null(relative.moving_before);
    validate["relative_error_in_band_moving_after"] = number_or_null(relative.moving_after);
  }
  json["effects"] = nlohmann::ordered_json::array();
  for (const Finding& finding : diagnosis.findings) json["effects"].push_back(effect_json(finding));
  json["unexplained"] = nlohmann::ordered_json::array();
  for (const diagnose::Unexplained& u : diagnosis.unexplained) {
    nlohmann::ordered_json evidence = nlohmann::ordered_json::object();
    for (const auto& [name, value] : u.evidence) evidence[name] = number_or_null(value);
    json["unexplained"].push_back(
        {{"joint", joint_or_null(u.joint)}, {"what", u.what}, {"evidence", std::move(evidence)}});
  }
  json["refused"] = nlohmann::ordered_json::array();
  for (const diagnose::Refusal& refusal : strongest(diagnosis)) {
    json["refused"].push_back({{"kind", refusal.effect.id()},
                               {"joint", joint_or_null(refusal.joint)},
                               {"why", refusal.why},
                               {"gain", number_or_null(refusal.gain)}});
  }
  json["validate_logs"] = nlohmann::ordered_json::array();
  for (std::size_t k = 0;
       k < std::min(diagnosis.validate_each_before.size(), diagnosis.validate_each_after.size()); ++k) {
    nlohmann::ordered_json entry{{"log", diagnosis.validate_each_after[k].log}};
    entry.update(before_after_json(diagnosis.validate_each_before[k], diagnosis.validate_each_after[k]));
    json["validate_logs"].push_back(std::move(entry));
  }
  json["errors_that_rise"] = errors_that_rise(diagnosis);
  json["candidates_tried"] = diagnosis.candidates;
  json["train_seconds"] = diagnosis.seconds;
  json["notes"] = diagnosis.notes;
  json["logs"] = {{"train", context.train}, {"validate", context.validate}};
  json["command"] = context.command;
  return json;
}

}  // namespace heft::report
