#include "diagnosis_result.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

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

}  // namespace

page::Table models_table(const validate::Score& given, const validate::Score& identified,
                         const validate::Score& diagnosed, const model::Robot& robot) {
  const std::string unit = torque_unit(robot);
  page::Table table({"joint", fmt::format("RMSE given [{}]", unit), "identified", "diagnosed", "change [%]",
                     fmt::format("in band given [{}]", unit), "identified", "diagnosed", "change [%]",
                     "R² given", "identified", "diagnosed"});
  if (!has_scores(given, diagnosed) || !has_scores(identified, diagnosed)) return table;
  const auto r2 = [](double value) { return std::isfinite(value) ? fmt::format("{:.4f}", value) : "–"; };
  for (Eigen::Index j = 0; j < diagnosed.rmse.size(); ++j) {
    std::vector<std::string> row{fmt::format("{}", j + 1)};
    for (const Eigen::VectorXd validate::Score::*error :
         {&validate::Score::rmse, &validate::Score::rmse_in_band}) {
      for (const validate::Score* score : {&given, &identified, &diagnosed})
        row.push_back(number((score->*error)[j], 3));
      row.push_back(percent_cell((identified.*error)[j], (diagnosed.*error)[j]));
    }
    for (const validate::Score* score : {&given, &identified, &diagnosed}) row.push_back(r2(score->r2[j]));
    table.add_row(std::move(row));
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

}  // namespace heft::report
