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

}  // namespace heft::report
