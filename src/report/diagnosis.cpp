#include "diagnosis_result.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "heft/host/words.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

host::Judgement judgement_of(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  host::Judgement judgement = diagnosis.judgement();
  judgement.add(context.torque);
  return judgement;
}

namespace {

/// Every finding with what speaks for it: what is missing first, then what the model given has no value for.
std::string findings_in_words(const Diagnosis& diagnosis) {
  const model::Robot& robot = diagnosis.after;
  std::string text;
  int rank = 0;
  std::vector<const Finding*> order = by_kind(diagnosis);
  std::stable_partition(order.begin(), order.end(), [](const Finding* f) { return !is_identified(*f); });
  for (const Finding* effect : order) {
    const Finding& finding = *effect;
    if (is_identified(finding) && (rank == 0 || !is_identified(*order[static_cast<std::size_t>(rank) - 1])))
      text += "\nIdentified, without a value in the model given\n";
    if (!is_identified(finding) && rank == 0) text += "\nFound missing\n";
    text += fmt::format("\n{}. {}\n", ++rank, host::capital(finding_in_place(diagnosis, finding)));
    const auto line = [&](const char* label, const std::string& content) {
      if (!content.empty()) text += fmt::format("   {:<12}{}\n", label, content);
    };
    line("kind", std::string(finding.effect.id()));
    line("term", effect_equation(finding));
    line("parameters", parameters_in_words(finding, robot));
    line("moves", moves_in_words(finding, robot));
    const plausibility::GearCheck gear = gear_check(finding, robot);
    line(gear.outcome == plausibility::GearCheck::Outcome::kImplausible ? "implausible" : "plausible",
         gear.words);
    line("evidence", evidence_in_words(finding));
    line("validation",
         finding.validate_before > 0.0
             ? fmt::format("joint {}: {} → {} {} ({})", finding.main_joint + 1,
                           number(finding.validate_before, 3), number(finding.validate_after, 3),
                           torque_unit(robot, finding.main_joint),
                           change_percent(finding.validate_before, finding.validate_after))
             : "");
    line("left out", finding.left_out.empty() ? "" : finding.left_out + ": not in the model written");
    line("stability",
         finding.stable.value_or(true) ? "" : "not stable: it shows in one half of the training logs only");
    line("seen at", finding.seen ? range_in_words(finding, robot) : "");
    line("rivals", rivals_in_words(finding.rivals, true));
    line("the same as", rivals_in_words(finding.equivalent, false));
    if (!finding.rivals.empty() || !finding.equivalent.empty()) line("shown by", shown_by(finding));
  }
  if (text.find("±") != std::string::npos) text += "\n±: 95 % intervals.\n";
  return text;
}

}  // namespace

std::string full(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  constexpr std::size_t kMostRefusals = 5;
  const model::Robot& robot = diagnosis.after;
  std::string text = brief(diagnosis) + "\n" + verdict_text(judgement_of(diagnosis, context));
  text += findings_in_words(diagnosis);
  if (const page::Table table = moved_by_joint_table(diagnosis); table.rows().size() > 1)
    text += "\nWhat they move, by joint\n" + table.to_text(2);
  if (const page::Table table = moved_by_kind_table(diagnosis); table.rows().size() > 1)
    text += "\nWhat they move, by kind\n" + table.to_text(2);
  const auto scores = [&](const char* title, const validate::Score& given, const validate::Score& identified,
                          const validate::Score& diagnosed) {
    const page::Table table = models_table(given, identified, diagnosed, robot);
    if (!table.rows().empty()) text += fmt::format("\n{}\n{}", title, table.to_text(2));
  };
  scores("Validation, not seen by the fit", diagnosis.validate_given, diagnosis.validate_identified,
         diagnosis.validate_after);
  scores("Training", diagnosis.train_given, diagnosis.train_identified, diagnosis.train_after);
  if (has_scores(diagnosis.validate_identified, diagnosis.validate_after)) {
    if (diagnosis.validate_torque.rmse_in_band.size() > 0) text += relative_error_in_words(diagnosis) + "\n";
    text +=
        fmt::format("{} {} The search reads positions through a low-pass of {}.\n",
                    score_meaning(diagnosis.validate_after), models_in_words(), cutoff_in_words(diagnosis));
  }
  if (diagnosis.validate_each_after.size() > 1) {
    const std::size_t count =
        std::min(diagnosis.validate_each_identified.size(), diagnosis.validate_each_after.size());
    for (std::size_t k = 0; k < count; ++k) {
      scores(diagnosis.validate_each_after[k].log.c_str(), diagnosis.validate_each_given[k],
             diagnosis.validate_each_identified[k], diagnosis.validate_each_after[k]);
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
  if (!diagnosis.ceilings.empty()) {
    text += fmt::format(
        "\nWhat any function of the motion could explain of the squared error (validation)\n{}{}\n",
        ceiling_table(diagnosis).to_text(2), ceiling_in_words(diagnosis));
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

}  // namespace heft::report
