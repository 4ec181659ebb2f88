// What the effects of a diagnosis move, and whether a gear can be like that.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "diagnosis_result.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using page::number;

bool moves(const Finding& finding) { return std::isfinite(finding.torque_rms) && finding.torque_joint >= 0; }

/// Joints or kinds with the effects that belong to them.
struct Group {
  std::vector<std::string> members;
  double rms{0.0}, peak{0.0};
};

void add(Group& group, const std::string& member, const Finding& finding) {
  if (std::find(group.members.begin(), group.members.end(), member) == group.members.end())
    group.members.push_back(member);
  // The largest of them: effects of one joint may cancel one another, and their sum says nothing.
  group.rms = std::max(group.rms, finding.torque_rms);
  group.peak = std::max(group.peak, finding.torque_peak);
}

}  // namespace

std::string moves_in_words(const Finding& finding, const model::Robot& robot) {
  if (!moves(finding)) return "";
  const std::string unit = torque_unit(robot, finding.torque_joint);
  std::string text = fmt::format("{} {} rms, {} {} at most in joint {}", number(finding.torque_rms, 3), unit,
                                 number(finding.torque_peak, 3), unit, finding.torque_joint + 1);
  const double share = finding.share_of_error();
  if (std::isfinite(share))
    text += fmt::format("; {:.0f} % of the squared error of joint {} on the validation logs goes with it",
                        100.0 * share, finding.main_joint + 1);
  return text;
}

page::Table moved_by_joint_table(const Diagnosis& diagnosis) {
  page::Table table({"joint", "effects", "largest, rms [N·m, N]", "largest, peak",
                     "validation RMSE identified", "diagnosed"});
  std::map<int, Group> joints;
  for (const Finding* finding : by_kind(diagnosis)) {
    if (moves(*finding)) add(joints[finding->torque_joint], std::string(finding->effect.id()), *finding);
  }
  const bool judged = has_scores(diagnosis.validate_identified, diagnosis.validate_after);
  for (const auto& [joint, group] : joints) {
    const bool known = judged && joint < diagnosis.validate_after.rmse.size();
    table.add_row({fmt::format("{}", joint + 1), fmt::format("{}", fmt::join(group.members, ", ")),
                   number(group.rms, 3), number(group.peak, 3),
                   known ? number(diagnosis.validate_identified.rmse[joint], 3) : "–",
                   known ? number(diagnosis.validate_after.rmse[joint], 3) : "–"});
  }
  return table;
}

page::Table moved_by_kind_table(const Diagnosis& diagnosis) {
  page::Table table({"kind", "joints", "largest, rms [N·m, N]", "largest, peak", "gear"});
  std::vector<std::pair<std::string, Group>> kinds;
  std::map<std::string, std::string> doubts;
  for (const Finding* finding : by_kind(diagnosis)) {
    if (!moves(*finding)) continue;
    const std::string kind(finding->effect.id());
    if (kinds.empty() || kinds.back().first != kind) kinds.emplace_back(kind, Group{});
    add(kinds.back().second, fmt::format("{}", finding->torque_joint + 1), *finding);
    if (gear_check(*finding, diagnosis.after).outcome == plausibility::GearCheck::Outcome::kImplausible)
      doubts[kind] += fmt::format("{}{}", doubts[kind].empty() ? "unlike one in joint " : ", ", finding->joint + 1);
  }
  for (const auto& [kind, group] : kinds) {
    table.add_row({kind, fmt::format("{}", fmt::join(group.members, ", ")), number(group.rms, 3),
                   number(group.peak, 3), doubts[kind]});
  }
  return table;
}

plausibility::GearCheck gear_check(const Finding& finding, const model::Robot& robot) {
  if (finding.joint < 0 || finding.joint >= robot.num_joints()) return {};
  return plausibility::check_gear(finding.effect, finding.parameters,
                                  robot.joints[static_cast<std::size_t>(finding.joint)]);
}

}  // namespace heft::report
