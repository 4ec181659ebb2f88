#include "diagnosis_result.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/page/table.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

/// Error of all joints against their torque, 100 ‖τ - τ̂‖ / ‖τ‖ [%].
double relative_error(const Eigen::VectorXd& error, const Eigen::VectorXd& torque) {
  return 100.0 * error.norm() / torque.norm();
}

}  // namespace

std::string p_in_words(double p) {
  if (!std::isfinite(p)) return "–";
  return p < 1e-300 ? "< 1e-300" : p < 1e-3 ? fmt::format("{:.0e}", p) : number(p, 2);
}

bool has_scores(const validate::Score& before, const validate::Score& after) {
  return before.rmse.size() > 0 && before.rmse.size() == after.rmse.size();
}

/// Refusals, those that would explain most first.
std::vector<diagnose::Refusal> strongest(const Diagnosis& diagnosis) {
  std::vector<diagnose::Refusal> refusals = diagnosis.refusals;
  std::stable_sort(refusals.begin(), refusals.end(),
                   [](const diagnose::Refusal& a, const diagnose::Refusal& b) { return a.gain > b.gain; });
  return refusals;
}

std::string unexplained_in_words(const diagnose::Unexplained& unexplained) {
  return unexplained.joint < 0 ? unexplained.what
                               : fmt::format("joint {}, {}", unexplained.joint + 1, unexplained.what);
}

RelativeErrors relative_errors(const Diagnosis& d) {
  const validate::Score& torque = d.validate_torque;
  const auto all = [&](const validate::Score& score) {
    return relative_error(score.rmse_in_band, torque.rmse_in_band);
  };
  const auto moving = [&](const validate::Score& score) {
    return relative_error(score.rmse_in_band_moving, torque.rmse_in_band_moving);
  };
  return {all(d.validate_before),    all(d.validate_identified),    all(d.validate_after),
          moving(d.validate_before), moving(d.validate_identified), moving(d.validate_after)};
}

std::string cutoff_in_words(const diagnose::Diagnosis& diagnosis) {
  std::string words = fmt::format("{:.3g} Hz", diagnosis.cutoff);
  const Eigen::VectorXd& each = diagnosis.joint_cutoffs;
  if (each.size() > 0 && each.maxCoeff() > each.minCoeff())
    words += fmt::format(" (joint by joint {:.3g} Hz)", fmt::join(each, ", "));
  return words;
}

std::string models_in_words() {
  return "Given: the model handed in. Identified: what heft identify makes of the training logs. Diagnosed: "
         "the same together with the effects.";
}

std::string range_in_words(const Finding& finding, const model::Robot& robot) {
  if (!finding.seen) return "";
  const char* length = is_prismatic(robot, finding.joint) ? "m" : "rad";
  const auto range = [](const double(&values)[2]) {
    return short_number(values[0], 3) + " to " + short_number(values[1], 3);
  };
  const std::string warmth = finding.effect.is<FrictionTemperature>() && finding.seen->temperature
                                 ? fmt::format(", temperature {} to {} °C", short_number((*finding.seen->temperature)[0], 3),
                                               short_number((*finding.seen->temperature)[1], 3))
                                 : "";
  return fmt::format("velocity {} {}/s, load {} {}, position {} {}", range(finding.seen->velocity), length,
                     range(finding.seen->load), torque_unit(robot, finding.joint),
                     range(finding.seen->position), length) +
         warmth;
}

bool is_identified(const Finding& finding) {
  return finding.effect.is<Offset>() || finding.effect.is<RotorInertia>();
}

std::string finding_in_place(const Diagnosis& diagnosis, const Finding& finding) {
  const auto same = std::count_if(
      diagnosis.findings.begin(), diagnosis.findings.end(),
      [&](const Finding& other) { return other.effect == finding.effect && other.joint == finding.joint; });
  const bool one_of_two = same > 1 && joint_effect_has_memory(finding.effect.joint_effect());
  return effect_in_place(finding.effect, finding.joint, finding.driven_joint) + (one_of_two ? ", one of two distances" : "");
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
    // What is left above noise and at which frequency is in the words already.
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
  std::string text =
      fmt::format("All joints together, in band: error identified {}, diagnosed {} % of the torque",
                  number(relative.identified, 3), number(relative.after, 3));
  if (std::isfinite(relative.moving_after)) {
    text += fmt::format("; without standstill at the ends {}, {} %", number(relative.moving_identified, 3),
                        number(relative.moving_after, 3));
  }
  return text + ".";
}

std::string rivals_in_words(const std::vector<diagnose::Rival>& rivals, bool with_score) {
  std::vector<std::string> parts;
  for (const diagnose::Rival& rival : rivals) {
    parts.push_back(
        effect_in_place(rival.effect, rival.joint, rival.driven_joint) +
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

std::vector<std::string> errors_that_rise(const Diagnosis& diagnosis) {
  std::vector<std::string> lines;
  const std::size_t logs =
      std::min(diagnosis.validate_each_identified.size(), diagnosis.validate_each_after.size());
  for (std::size_t k = 0; k < logs; ++k) {
    const validate::Score &before = diagnosis.validate_each_identified[k],
                          &after = diagnosis.validate_each_after[k];
    if (!has_scores(before, after)) continue;
    for (Eigen::Index j = 0; j < before.rmse.size(); ++j) {
      if (after.rmse[j] <= diagnose::kWorse * before.rmse[j]) continue;
      const bool has_band = j < std::min(before.rmse_in_band.size(), after.rmse_in_band.size()) &&
                            std::isfinite(before.rmse_in_band[j]) && std::isfinite(after.rmse_in_band[j]);
      lines.push_back(fmt::format("{}: joint {}: identified {}, diagnosed {} {} ({}{})", before.log, j + 1,
                                  number(before.rmse[j], 3), number(after.rmse[j], 3),
                                  torque_unit(diagnosis.after, static_cast<int>(j)),
                                  change_percent(before.rmse[j], after.rmse[j]),
                                  has_band ? ", in band " + change_percent(before.rmse_in_band[j],
                                                                           after.rmse_in_band[j])
                                           : ""));
    }
  }
  return lines;
}

}  // namespace heft::report
