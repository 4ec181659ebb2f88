// Backward checks: what each accepted effect is worth next to the others, and what could stand in its place.
#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/host/parallel.hpp"
#include "search.hpp"

namespace heft::diagnose {

namespace {

/// Least gain of what could stand in the place of an effect of a joint, or be its rival.
/// @param effect  as the model without it judges it
double of_use_in_place_of(const Candidate& effect) {
  // Far below kRival: shapes tried first may be far from the best, and what leaves next to nothing gains more by its logarithm.
  constexpr double kOfUse = 0.05;
  if (effect.joint < 0 || effect.is_elastic()) return 0.0;
  return effect.trial.valid ? kOfUse * effect.trial.gain : 0.0;
}

/// Whether an effect of one joint has a better shape when it is found again: others have been taken since. Memories are found again
/// whenever one is.
/// @param found, own  as the same model judges them
bool has_better_shape(const Candidate& found, const Candidate& own) {
  constexpr double kBetter = 1.01;
  return own.effect.joint_effect() >= 0 && !own.has_memory() && found.shape != own.shape && found.trial.valid && own.trial.valid &&
         found.trial.cv_gain > kBetter * own.trial.cv_gain;
}

}  // namespace

void Search::backward() {
  constexpr int kMostTimes = 3;
  for (int time = 1;; ++time) {
    exchanged_elsewhere_ = false;
    for (std::size_t e = 0; e < engine().accepted.size() && engine().accepted.size() > 1;) {
      if (check(e)) ++e;
    }
    exchanged_elsewhere_ = one_scale_for_two() || exchanged_elsewhere_;
    // Whatever is taken is looked at again: none the last time.
    if (!exchanged_elsewhere_ || time == kMostTimes) break;
    // An effect of another place stood in for what is there: the one that went may be there as well.
    const std::size_t before = engine().accepted.size();
    forward(false);
    if (engine().accepted.size() == before) break;
    tune();  // springs and delays were found without it
  }
  progress(kBackward);
}

bool Search::check_again(int joint) {
  bool changed = false;
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    if (engine().accepted[e].joint != joint || engine().accepted[e].is_elastic()) continue;
    const Candidate own = engine().accepted[e];
    const bool stays = check(e);
    changed = changed || !stays || !same_effect(own, engine().accepted[e]);
    if (!stays) --e;
  }
  return changed;
}

std::ptrdiff_t Search::other_spring(std::size_t e) const {
  const std::vector<Candidate>& accepted = engine().accepted;
  if (!accepted[e].is_elastic()) return -1;
  for (std::size_t k = 0; k < accepted.size(); ++k) {
    if (k != e && accepted[k].is_elastic()) return static_cast<std::ptrdiff_t>(k);
  }
  return -1;
}

/// Torque scales of all joints but one: two joints that share masses only with each other may each be the one that is off.
void Search::add_scales_of_others(int joint, const Engine& rest, std::vector<Candidate>& found) const {
  const std::vector<bool> joints = looked_at({});
  for (int other = 0; other < start_.robot.num_joints(); ++other) {
    if (other == joint || !joints[static_cast<std::size_t>(other)]) continue;
    Candidate scale(TorqueScale{});
    scale.joint = other;
    for (Candidate& c : rest.forms_of(scale)) found.push_back(std::move(c));
  }
  sort_by_gain(found);
}

/// Masses follow the joint whose torque is scaled: then the scales of the joints before and behind it seem to be off. One scale of a
/// third joint that explains nearly as much as the two takes their place.
/// @return whether it stands in their place now
bool Search::one_scale_for_two() {
  std::vector<std::ptrdiff_t> scales;
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    if (engine().accepted[e].effect.is<TorqueScale>()) scales.push_back(static_cast<std::ptrdiff_t>(e));
  }
  for (std::size_t second = 1; second < scales.size(); ++second) {
    for (std::size_t first = 0; first < second; ++first) {
      const Candidate& one = engine().accepted[static_cast<std::size_t>(scales[first])];
      const Candidate& other = engine().accepted[static_cast<std::size_t>(scales[second])];
      std::unique_ptr<Engine> tried =
          rebuilt(scales[first], engine().weights_held, engine().masses_held, -1, scales[second]);
      std::vector<Candidate> found;
      add_scales_of_others(one.joint, *tried, found);
      const Rules::Round round{std::max(tried_, tried_of(found)), tried->noise_floor(), tried->accepted};
      const auto third = std::find_if(found.begin(), found.end(), [&](const Candidate& c) {
        return c.joint != other.joint && rules().objection(c, round).empty();
      });
      if (third == found.end()) continue;
      const double without = tried->mean_log_error();
      tried->put(tried->accepted.size(), *third);
      tried->build();
      if (without - tried->mean_log_error() < kSimpler * (without - engine().mean_log_error())) continue;
      trace(fmt::format("exchanged {} and {} for {}", name_of(one), name_of(other), name_of(*third)));
      take_over(std::move(tried));
      return true;
    }
  }
  return false;
}

/// What could stand in the place of an accepted effect.
/// @param own   the effect as `rest` judges it
/// @param rest  the model without it
std::vector<Candidate> Search::in_place_of(std::size_t e, const Candidate& own, const Engine& rest) const {
  const std::ptrdiff_t other = other_spring(e);
  if (other < 0) {
    std::vector<Candidate> found =
        propose(rest, own.joint < 0 ? std::vector<int>{} : std::vector{own.joint}, {}, of_use_in_place_of(own));
    if (own.effect.is<TorqueScale>()) add_scales_of_others(own.joint, rest, found);
    return found;
  }
  std::vector<Candidate> found = propose(rest, {own.joint, engine().accepted[static_cast<std::size_t>(other)].joint});
  add_spring_pairs(rest, {own.joint, engine().accepted[static_cast<std::size_t>(other)].joint}, found);
  std::erase_if(found, [&](const Candidate& c) { return c.joint >= 0 && c.joint != own.joint && !c.is_elastic(); });
  return found;
}

std::shared_ptr<const Present> Search::present() {
  const std::lock_guard<std::mutex> lock(present_asked_);
  if (present_ == nullptr) present_ = present_of(engine());
  return present_;
}

Evidence Search::found_without(std::size_t e) {
  Candidate own = engine().accepted[e];
  // A memory found with its joint's standstill is compared with it as well.
  const std::unique_ptr<Engine> rest = rebuilt(static_cast<std::ptrdiff_t>(e), engine().weights_held,
                                               engine().masses_held, own.has_memory() ? own.joint : -1, other_spring(e));
  if (own.joint >= 0 && !own.is_elastic()) {
    own.stale = true;
    rest->judge_again(own);
  }
  std::vector<Candidate> candidates = in_place_of(e, own, *rest);
  return {checked(std::move(own), present()), rest->noise_floor(), std::move(rest->accepted), std::move(candidates)};
}

/// As long as no effect goes or is exchanged, which is seldom, the next ones are looked at without each at the same time.
/// @param with_columns  those of the candidates are needed
Evidence& Search::without(std::size_t e, bool with_columns) {
  constexpr std::size_t kTogether = 4;  // what they hold takes memory
  const std::shared_ptr<const Present> now = present();
  const auto kept = [&](std::size_t of) { return evidence_.of(engine(), *now, of); };
  if (Evidence* found = kept(e); found != nullptr && (found->has_columns || !with_columns)) return *found;
  const std::size_t count = engine().accepted.size();
  std::vector<std::size_t> missing{e};
  for (std::size_t other = e + 1; !with_columns && other < count && missing.size() < kTogether; ++other) {
    if (kept(other) == nullptr) missing.push_back(other);
  }
  const double share = static_cast<double>(e) / static_cast<double>(count);
  progress(kForward + (kBackward - kForward) * share);
  std::vector<std::optional<Evidence>> found(missing.size());
  host::for_each_parallel(missing.size(), [&](std::size_t k) { found[k] = found_without(missing[k]); });
  for (std::size_t k = found.size(); k-- > 1;) evidence_.keep(std::move(*found[k]));
  return evidence_.keep(std::move(*found[0]));
}

Search::InPlace Search::best_in_place_of(std::size_t e, const Evidence& evidence) const {
  const Candidate& own = engine().accepted[e];
  const Rules::Round round{std::max(tried_, tried_of(evidence.candidates)), evidence.noise_floor, evidence.taken};
  const Candidate *same = nullptr, *best = nullptr;
  for (const Candidate& c : evidence.candidates) {
    if (holds(c, own) && (same == nullptr || !c.parts.empty())) same = &c;
    if (best == nullptr && rules().objection(c, round).empty()) best = &c;
  }
  if (best != nullptr) best = rules().simplest(evidence.candidates, best, round);
  if (best != nullptr && best->is_elastic()) {
    // Springs are looked at together: this one stays if what does best has it, and goes if the other one does as well alone.
    if (holds(*best, own)) {
      same = best;
    } else if (other_spring(e) >= 0) {
      best = nullptr;
    }
  }
  return {same, best, own.effect.is<Contact>() || (best != nullptr && best == same)};
}

/// Takes one effect out and looks at what does best in its place.
/// @return whether an effect stays in that place
bool Search::check(std::size_t e) {
  const Candidate own = engine().accepted[e];
  Evidence* evidence = &without(e, false);
  InPlace found = best_in_place_of(e, *evidence);
  if (!found.stays && !evidence->has_columns) {
    evidence = &without(e, true);
    found = best_in_place_of(e, *evidence);
  }
  const auto [same, best, stays] = found;
  if (!stays && other_spring(e) >= 0 && find_evidence_beside_other_spring(e)) return true;
  // A memory was compared in each of its forms above; the first of two takes its own distance again.
  const bool remembers = own.has_memory() && !own.beside;
  if (!stays && best == nullptr) {
    evidence->drop_columns();
    refusals_.taken_out(own, "another effect has made it needless", 0.0);
    model().accepted.erase(model().accepted.begin() + static_cast<std::ptrdiff_t>(e));
    model().build();
    if (!remembers) find_memory_again(own.joint);
    return false;
  }
  if (!stays && (same == nullptr || best->trial.cv_gain > 1.02 * same->trial.cv_gain)) {
    trace(fmt::format("exchanged {} for {}", name_of(own), name_of(*best)));
    exchanged_elsewhere_ = exchanged_elsewhere_ || best->joint != own.joint;
    model().put(e, *best);
    model().build();
    if (!remembers) find_memory_again(own.joint);
  } else if (same != nullptr && has_better_shape(*same, evidence->of.own)) {
    evidence = &without(e, true);
    const Candidate again = *best_in_place_of(e, *evidence).same;
    trace(fmt::format("{}: {:.4g} now, was {:.4g}", name_of(own), again.shape, own.shape));
    model().put(e, again);
    model().build();
  }
  evidence->drop_columns();
  return true;
}

/// Looks at a spring once more with another one in place, around whose motion the fit is: where both are large, a search from
/// rigid joints may find neither with both.
/// @return whether it would be taken again
bool Search::find_evidence_beside_other_spring(std::size_t e) {
  const Candidate& own = engine().accepted[e];
  const std::unique_ptr<Engine> rest = rebuilt_without(e);
  std::vector<Candidate> candidates = propose(*rest, {own.joint});
  Evidence found{checked(own, present()), rest->noise_floor(), std::move(rest->accepted), std::move(candidates)};
  const Rules::Round round{std::max(tried_, tried_of(found.candidates)), found.noise_floor, found.taken};
  const auto taken = [&](const Candidate& c) { return holds(c, own) && rules().objection(c, round).empty(); };
  if (std::none_of(found.candidates.begin(), found.candidates.end(), taken)) return false;
  found.drop_columns();
  evidence_.keep(std::move(found));
  return true;
}

}  // namespace heft::diagnose
