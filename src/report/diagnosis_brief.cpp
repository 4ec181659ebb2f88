#include "diagnosis_result.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/words.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

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

/// What is left of one kind: noise of the measurement, or anything else.
std::vector<diagnose::Unexplained> left_of(const Diagnosis& diagnosis, bool noise) {
  std::vector<diagnose::Unexplained> left;
  for (const diagnose::Unexplained& u : diagnosis.unexplained) {
    if (u.is_noise() == noise) left.push_back(u);
  }
  return left;
}

/// " Correlated noise remains in joint 2: it goes with no function of the motion."; empty: none.
std::string noise_that_is_left(const Diagnosis& diagnosis) {
  std::set<int> steps, others;
  for (const diagnose::Unexplained& u : left_of(diagnosis, true))
    (u.cause == diagnose::Cause::kQuantisation ? steps : others).insert(u.joint);
  std::string text;
  if (!steps.empty()) {
    text += fmt::format(" The steps of the encoders show as noise in {}.",
                        host::joints_in_words({steps.begin(), steps.end()}));
  }
  if (!others.empty()) {
    text += fmt::format(
        " Noise that is correlated in time remains in {}: no function of the motion was found that explains it.",
        host::joints_in_words({others.begin(), others.end()}));
  }
  return text;
}

/// One in full, several by their joints.
std::string what_is_left(const std::vector<diagnose::Unexplained>& unexplained) {
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
  for (const diagnose::Rival& rival : rivals) names.push_back(effect_in_place(rival.effect, rival.joint, rival.driven_joint));
  return names;
}

/// "presliding (friction hysteresis) in joints 1, 3 and 5", one entry a kind, the one with the strongest effect first.
std::vector<std::string> kinds_in_place(const std::vector<Finding>& findings) {
  struct Entry {
    EffectKind kind;
    std::set<int> joints;
    std::string of_pair;  ///< an effect of two joints stands alone
  };
  std::vector<Entry> entries;
  for (const Finding& finding : findings) {
    if (finding.driven_joint >= 0) {
      entries.push_back({finding.effect, {}, effect_in_place(finding.effect, finding.joint, finding.driven_joint)});
      continue;
    }
    auto at = std::find_if(entries.begin(), entries.end(), [&](const Entry& e) { return e.kind == finding.effect; });
    if (at == entries.end()) at = entries.insert(at, {finding.effect, {}, {}});
    if (finding.joint >= 0) at->joints.insert(finding.joint);
  }
  std::vector<std::string> words;
  for (const auto& [kind, joints, of_pair] : entries) {
    words.push_back(!of_pair.empty()  ? of_pair
                    : joints.empty() ? effect_name(kind)
                                     : effect_name(kind) + " in " + host::joints_in_words({joints.begin(), joints.end()}));
  }
  return words;
}

/// "5 effects are missing, the strongest ...; rotor inertia in joint 3, which the given model has no value for, is
/// identified": what is missing and what anyone would identify.
std::string kinds_of(const std::vector<Finding>& findings) {
  constexpr std::size_t kMostNames = 3;
  std::vector<Finding> missing, known;
  for (const Finding& finding : findings) (is_identified(finding) ? known : missing).push_back(finding);
  std::vector<std::string> effects = kinds_in_place(missing);
  const bool some = effects.size() > kMostNames;
  if (some) effects.resize(kMostNames);
  std::string text =
      missing.empty()
          ? "No effect is missing beyond what the given model has no value for and identify finds: "
      : missing.size() == 1
          ? "One effect is missing: "
          : fmt::format("{} effects are missing{}", missing.size(), some ? ", the strongest " : ": ");
  text += list_of(missing.empty() ? kinds_in_place(known) : effects);
  if (missing.empty() || known.empty()) return text;
  return text + fmt::format("; beside {} the given model has no value for {}, which identify finds",
                            missing.size() == 1 ? "it" : "these", list_of(kinds_in_place(known)));
}

/// " Left out of the model written: presliding in joint 3, which predicts ...": what was found and does harm there.
std::string left_out_of(const std::vector<Finding>& findings) {
  std::vector<Finding> out;
  for (const Finding& finding : findings) {
    if (!finding.left_out.empty()) out.push_back(finding);
  }
  if (out.empty()) return "";
  return fmt::format(" Left out of the model written: {}, {}.", list_of(kinds_in_place(out)),
                     out.size() == 1 ? "as it " + out.front().left_out
                                     : "as each predicts a joint worse than the identified model");
}

/// Fall of a joint's error on the validation logs, as a share.
struct Fall {
  int joint;
  double share;
};
/// Share from which the sentence at the top names a joint other than the main one.
constexpr double kMuch = 0.2;

/// All joints, the largest fall first.
std::vector<Fall> falls(const Diagnosis& diagnosis) {
  std::vector<Fall> all;
  const validate::Score &before = diagnosis.validate_identified, &after = diagnosis.validate_after;
  if (!has_scores(before, after)) return all;
  for (Eigen::Index j = 0; j < before.rmse.size(); ++j) {
    if (before.rmse[j] > 0.0) all.push_back({static_cast<int>(j), 1.0 - after.rmse[j] / before.rmse[j]});
  }
  std::stable_sort(all.begin(), all.end(), [](const Fall& a, const Fall& b) { return a.share > b.share; });
  return all;
}

/// "joint 2 (0.43 → 0.29 N·m, −33 %)".
std::string fall_in_words(const Diagnosis& diagnosis, int joint) {
  const double before = diagnosis.validate_identified.rmse[joint],
               after = diagnosis.validate_after.rmse[joint];
  return fmt::format("joint {} ({} → {} {}, {})", joint + 1, number(before, 3), number(after, 3),
                     torque_unit(diagnosis.after, joint), change_percent(before, after));
}

}  // namespace

std::string brief(const Diagnosis& diagnosis) {
  const std::size_t logs = std::max<std::size_t>(1, diagnosis.validate_each_after.size());
  const std::string left = what_is_left(left_of(diagnosis, false)), noise = noise_that_is_left(diagnosis);
  if (!diagnosis.not_explained.empty()) {
    // Before anything else: what the small effects are worth is of no interest while a joint is wrong.
    std::string text;
    for (const diagnose::NotExplained& joint : diagnosis.not_explained)
      text += (text.empty() ? "" : " ") + host::capital(diagnose::in_words(joint, diagnosis.after)) + ".";
    Diagnosis others = diagnosis;
    others.not_explained.clear();
    return others.findings.empty() ? text : text + " In the other joints: " + brief(others);
  }
  if (diagnosis.findings.empty()) {
    if (!left.empty()) return fmt::format("An unexplained residual remains: {}.{}", left, noise);
    return std::string(
               "Nothing is missing: rigid bodies with Coulomb and viscous friction explain these logs, and no "
               "further effect lowers the error on data not fitted by more than chance and by enough to matter.") +
           noise;
  }
  std::string text;
  const std::string left_out = left_out_of(diagnosis.findings);
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
    constexpr std::size_t kMostJoints = 2;
    std::vector<std::string> joints;
    text = kinds_of(diagnosis.findings);
    for (const Fall& fall : falls(diagnosis)) {
      if (fall.share > 0.0 && joints.size() < kMostJoints)
        joints.push_back(fall_in_words(diagnosis, fall.joint));
    }
    if (!joints.empty()) {
      text += fmt::format(". With {} the error on the validation log{} falls most in {}",
                          left_out.empty() ? "all of them" : "those in the model written",
                          logs > 1 ? "s" : "", list_of(joints));
    }
    text += ".";
  }
  text += left_out;
  if (!left.empty()) text += fmt::format(" Beyond that an unexplained residual remains: {}.", left);
  return text + noise;
}

model::ModelFile model_file(const Diagnosis& diagnosis) {
  model::ModelFile file = diagnosis.model_file();
  std::vector<std::string>& notes = file.provenance.notes;
  notes = {brief(diagnosis)};
  for (const Finding& finding : diagnosis.findings) {
    notes.push_back(fmt::format("{}: {}; {}{}", finding_in_place(diagnosis, finding),
                                parameters_in_words(finding, diagnosis.after), evidence_in_words(finding),
                                finding.left_out.empty() ? "" : "; not in this model: " + finding.left_out));
  }
  notes.insert(notes.end(), diagnosis.notes.begin(), diagnosis.notes.end());
  return file;
}

int most_improved_joint(const Diagnosis& diagnosis) {
  const std::vector<Fall> all = falls(diagnosis);
  return all.empty() ? -1 : all.front().joint;
}

}  // namespace heft::report
