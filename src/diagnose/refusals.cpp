#include "refusals.hpp"

#include <algorithm>
#include <utility>

#include "rules.hpp"

namespace heft::diagnose {

void Refusals::not_taken(const Candidate& c, const std::string& why) {
  if (why.empty() || !c.trial.valid || c.trial.joint_before.size() == 0) return;
  const double size = fall(c.trial).maxCoeff();
  if (size > 0.5 * kRelevantGain) not_taken_.push_back({c.effect, c.joint, why, squared(size)});
}

std::vector<Refusal> Refusals::beside(const std::vector<Finding>& findings) const {
  std::vector<Refusal> sorted = not_taken_;
  sorted.insert(sorted.end(), taken_out_.begin(), taken_out_.end());
  std::erase_if(sorted, [&](const Refusal& r) {
    return std::any_of(findings.begin(), findings.end(),
                       [&](const Finding& f) { return f.effect == r.effect && f.joint == r.joint; });
  });
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Refusal& a, const Refusal& b) { return a.gain > b.gain; });
  // What was refused in two forms is listed once, as its stronger one.
  std::vector<Refusal> once;
  for (Refusal& r : sorted) {
    const auto same = [&](const Refusal& o) { return o.effect == r.effect && o.joint == r.joint; };
    if (std::none_of(once.begin(), once.end(), same)) once.push_back(std::move(r));
  }
  return once;
}

}  // namespace heft::diagnose
