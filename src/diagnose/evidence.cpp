#include "evidence.hpp"

#include <algorithm>
#include <utility>

#include "rules.hpp"

namespace heft::diagnose {
namespace {

/// Whether what could stand in an effect's place is looked for in its joint only.
bool is_of_one_joint(const Candidate& effect) {
  return effect.effect.joint_effect() >= 0 && !effect.effect.is<TorqueScale>();
}

}  // namespace

std::shared_ptr<const Present> present_of(const Engine& engine) {
  return std::make_shared<const Present>(
      Present{engine.predicted().cwiseProduct(engine.keep()), engine.problem().counted(), engine.weights_held, engine.masses_held});
}

bool hardly_changed(const Problem& problem, const Present& before, const Present& now, int joint) {
  constexpr double kHardly = 0.02;
  if (before.predicted.rows() != now.predicted.rows() || before.counted[joint] != now.counted[joint]) return false;
  if (before.weights_held != now.weights_held || before.masses_held != now.masses_held) return false;
  const double change = (now.predicted.col(joint) - before.predicted.col(joint)).squaredNorm();
  return !(change > kHardly * kHardly * problem.squares_of(joint));
}

Checked checked(Candidate own, std::shared_ptr<const Present> model) {
  own.columns = {};
  return {std::move(own), std::move(model)};
}

bool still_holds(const Checked& found, const Candidate& own, const Engine& engine, const Present& now) {
  if (!same_effect(found.own, own) || found.own.shape != own.shape || found.own.second != own.second) return false;
  for (int j = 0; j < engine.table().num_joints; ++j) {
    if (is_of_one_joint(own) && j != own.joint) continue;
    if (!hardly_changed(engine.problem(), *found.model, now, j)) return false;
  }
  return true;
}

void Evidence::drop_columns() {
  for (Candidate& c : candidates) c.columns = {};
  for (Candidate& c : taken) c.columns = {};
  has_columns = false;
}

Evidence& EvidenceKept::keep(Evidence evidence) {
  std::erase_if(kept_, [&](const Evidence& e) { return same_effect(e.of.own, evidence.of.own); });
  kept_.push_back(std::move(evidence));
  return kept_.back();
}

Evidence* EvidenceKept::of(const Engine& engine, const Present& now, std::size_t effect) {
  const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const Evidence& e) {
    return still_holds(e.of, engine.accepted[effect], engine, now);
  });
  return found == kept_.end() ? nullptr : &*found;
}

}  // namespace heft::diagnose
