#include "rules.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include <fmt/format.h>

namespace heft::diagnose {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// An effect that takes away more than this of a joint's error is no matter of chance.
constexpr double kMostOfTheError = 0.5;

/// Whether an effect of the whole arm takes away most of the error of the joint where it shows most, as a wrist
/// coupling or a tilted base does; events would only follow the error of a joint that nothing explains.
bool explains_joints(const Candidate& c) {
  return !c.effect.is<Contact>() && !c.effect.is<PayloadChange>() && c.trial.joint_before.size() > 0 &&
         fall(c.trial).maxCoeff() > kMostOfTheError;
}

/// Whether a spring, or one of two that are taken together, is of a joint.
bool is_of(const Candidate& spring, int joint) {
  return spring.parts.empty() ? spring.joint == joint
                              : std::any_of(spring.parts.begin(), spring.parts.end(), [&](const Candidate& p) { return p.joint == joint; });
}

/// Whether rotor inertia in place in a spring's joints, which the spring takes over as its motor's, gained nearly as much as both
/// do: where accelerations are noisy, a spring that swings fast bends the spectrum of what the rotor sees by a little.
bool rotors_suffice(const Candidate& spring, const std::vector<Candidate>& taken) {
  double gain = 0.0;
  for (const Candidate& e : taken) {
    if (e.effect.is<RotorInertia>() && is_of(spring, e.joint)) gain += e.trial.cv_gain;
  }
  return gain > kSimpler * (gain + spring.trial.cv_gain);
}

/// What speaks against some effects alone; empty: nothing.
std::string own_objection(const Candidate& c, const MotionTable& table, bool joint_sensor) {
  if (c.effect.is<FrictionDrift>() && c.shape < kQuickestWarming)
    return "too quick for a joint that warms up";
  if (c.effect.is<Spring>()) {
    const auto q = table.q.col(c.joint);
    const double slope = std::abs(c.trial.coefficients[0]) * 0.5 * (q.maxCoeff() - q.minCoeff());
    const double middle =
        c.trial.coefficients[0] * 0.5 * (q.maxCoeff() + q.minCoeff()) + c.trial.coefficients[1];
    if (slope < 0.25 * std::abs(middle)) return "is an offset rather than a spring";
  }
  if (c.effect.is<TorqueScale>() && std::abs(c.trial.coefficients[0]) > kLargestScale)
    return "off by so much it is another unit, sign or robot";
  if (c.effect.is<FrictionCurve>() && fall(c.trial)[c.joint] < kMostOfTheError &&
      std::accumulate(table.run_seconds.begin(), table.run_seconds.end(), 0.0) < kCurveSeconds)
    return "needs half a minute of motion";
  if (c.has_memory() && table.encoder_step.size() > 0 && c.shape < table.encoder_step[c.joint])
    return "its memory length is below one step of the encoder";
  if (c.effect.is<Delay>() && c.shape * table.logged_rate < kShortestDelay)
    return "below half a sample period: channels of one log may be that far apart";
  if (joint_sensor && c.effect.is<RotorInertia>()) return "a sensor behind the gear does not feel the rotor";
  return {};
}

}  // namespace

VectorXd fall(const Trial& trial) {
  VectorXd result = VectorXd::Zero(trial.joint_before.size());
  for (Index j = 0; j < result.size(); ++j) {
    if (trial.joint_before[j] > 0.0) {
      result[j] = 1.0 - std::sqrt(std::max(0.0, trial.joint_after[j]) / trial.joint_before[j]);
    }
  }
  return result;
}

Index main_joint_of(const Trial& trial) {
  Index joint = 0;
  if (trial.joint_before.size() > 0) fall(trial).maxCoeff(&joint);
  return joint;
}

bool is_steady(const Trial& trial) {
  return trial.cv_t > kSteadyGain || (trial.cv_t > kSteadyGainOfFew && trial.lost < kNextToNothing);
}

bool runs_agree(const Trial& trial) {
  const auto& runs = trial.run_gain;
  return runs.size() >= kRunsThatAgree && *std::min_element(runs.begin(), runs.end()) > 0.0;
}

double relevant_gain(const Trial& trial) { return runs_agree(trial) ? kRelevantGainInRuns : kRelevantGain; }

int parameters_of(const Candidate& c) {
  // Of an event begin and length are chosen as well as its force.
  return static_cast<int>(c.trial.coefficients.size() + 2 * static_cast<Index>(c.events.size())) +
         (c.tried > 1 ? 1 : 0);
}

double bic_of(const Candidate& c, int candidates) {
  return -c.trial.wald + parameters_of(c) * std::log(std::max(2.0, c.trial.effective_rows)) +
         2.0 * std::log(std::max(1.0, static_cast<double>(candidates)));
}

std::vector<double> gained_once_more(const std::vector<Candidate>& candidates, const std::vector<Candidate>& taken) {
  std::vector<double> gains;
  for (const Candidate& e : taken) {
    const auto again = std::find_if(candidates.begin(), candidates.end(),
                                    [&](const Candidate& c) { return c.parts.empty() && same_place(c, e) && c.trial.valid; });
    gains.push_back(again != candidates.end() ? again->trial.cv_gain : 0.0);
  }
  return gains;
}

int tried_of(const std::vector<Candidate>& candidates) {
  int tried = 0;
  for (const Candidate& c : candidates) tried += c.tried;
  return tried;
}

bool same_effect(const Candidate& a, const Candidate& b) {
  return same_place(a, b) && (a.replaces >= 0) == (b.replaces >= 0) && a.displacement == b.displacement &&
         a.beside == b.beside;
}

bool holds(const Candidate& c, const Candidate& effect) {
  return c.parts.empty() ? same_effect(c, effect)
                         : std::any_of(c.parts.begin(), c.parts.end(), [&](const Candidate& p) { return same_place(p, effect); });
}

bool of_its_joints(const Candidate& c, const Candidate& other) {
  return c.joint == other.joint || (other.effect.is<Cable>() && c.joint == other.pair.driven);
}

std::string name_of(const Candidate& c) {
  if (!c.parts.empty())
    return fmt::format("{} on joints {} and {}", c.effect.id(), c.parts[0].joint + 1, c.parts[1].joint + 1);
  return c.joint >= 0 ? fmt::format("{} on joint {}", c.effect.id(), c.joint + 1)
                      : std::string(c.effect.id());
}

void sort_by_gain(std::vector<Candidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.trial.cv_gain > b.trial.cv_gain; });
}

bool Rules::is_wrong(int joint) const {
  return std::any_of(wrong_joints->begin(), wrong_joints->end(),
                     [joint](const NotExplained& u) { return u.joint == joint; });
}

std::string Rules::objection(const Candidate& c, const Round& round) const {
  if (!c.refused.empty()) return c.refused;
  const auto in_place = std::count_if(round.taken.begin(), round.taken.end(),
                                      [&](const Candidate& e) { return same_place(e, c); });
  // A second memory stands beside the first one, and what other effects hid may show more touches.
  if (in_place > (c.beside ? 1 : 0) && !c.effect.is<Contact>()) return "is in the model already";
  if (std::any_of(refused->begin(), refused->end(), [&](const Candidate& e) { return same_place(e, c); }))
    return "raises the error on the validation logs";
  if (!c.trial.valid) return "this motion cannot distinguish it from the rest of the model";
  // A joint's scale is measured by the masses that it shares with the others: one that is wrong spoils it.
  const bool by_all = c.joint < 0 || c.effect.is<TorqueScale>();
  if (by_all ? !wrong_joints->empty() && (c.joint >= 0 || !explains_joints(c))
             : is_wrong(c.joint) || (c.effect.is<Cable>() && is_wrong(c.pair.driven)))
    return "the arm model does not explain this joint";
  if (std::string own = own_objection(c, engine->table(), joint_sensor); !own.empty()) return own;
  if (!(c.trial.p_value * round.tried < kLevel)) return "chance explains it";
  if (c.effect.is<Contact>()) return {};
  const bool at_turns = c.at_turns > (c.effect.is<FrictionCurve>() ? kCurveAtTurns : kAtTurns);
  if (at_turns && squared(fall(c.trial).maxCoeff()) < kBothSides)
    return "shows only around reversals, whose instant the low-pass leaves open";
  if (!c.in_time() && c.trial.drift > kHolds) return "comes and goes: it is not the same all the time";
  if (!is_steady(c.trial)) return "does not help on stretches that it was not fitted to";
  // Several runs that agree say what one run leaves open.
  const bool agreed = runs_agree(c.trial);
  if (c.beside && !agreed) return "a second memory length needs three runs that agree on it";
  Index main = 0;
  const double size = fall(c.trial).maxCoeff(&main);
  const bool certain = c.trial.p_value * round.tried < kCertain;
  if (!(size > (certain ? kCertainGain : relevant_gain(c.trial)))) return kTooSmall;
  if (c.effect.is<Delay>() && (fall(c.trial).array() > std::min(0.5 * kRelevantGain, 0.25 * size)).count() < 2)
    return "shows in one joint only: a late channel is late for all";
  const double rows = engine->problem().counted()[main];
  const double floor = rows * round.noise_floor[main] * round.noise_floor[main];
  const double above = std::max(1e-300, c.trial.joint_before[main] - floor);
  const double least = agreed ? kNamingShareInRuns : kNamingShare;
  if ((c.trial.joint_before[main] - c.trial.joint_after[main]) / above < least)
    return "explains only a small part of what is left there";
  if (c.is_elastic() && rotors_suffice(c, round.taken)) return "rotor inertia explains nearly as much";
  if (!c.beside && repeats(c, round)) return "its torque follows that of an effect in the model";
  return {};
}

namespace {

/// Torque of a candidate, or of an effect in place, in the rows of a joint, about its mean; no rows: it does not reach it.
VectorXd torque_in(const Candidate& c, const VectorXd& coefficients, Index joint) {
  const auto found = std::find(c.columns.joints.begin(), c.columns.joints.end(), static_cast<int>(joint));
  if (found == c.columns.joints.end() || coefficients.size() != c.columns.count()) return {};
  const VectorXd torque = c.columns.values[static_cast<std::size_t>(found - c.columns.joints.begin())] * coefficients;
  return torque.array() - torque.mean();
}

}  // namespace

bool Rules::repeats(const Candidate& c, const Round& round) const {
  for (std::size_t e = 0; e < round.once_more.size(); ++e) {
    if (!(round.once_more[e] > kOnceMore * c.trial.cv_gain)) continue;
    const Index joint = main_joint_of(c.trial);
    const VectorXd own = torque_in(c, c.trial.coefficients, joint);
    const VectorXd other = torque_in(round.taken[e], engine->coefficients(e), joint);
    if (own.size() == 0 || other.size() != own.size()) continue;
    // ρ² = (x·y)² / (x·x y·y)
    const double product = own.dot(other);
    if (product * product > kFollows * own.squaredNorm() * other.squaredNorm()) return true;
  }
  return false;
}

namespace {

/// Whether each of two springs adds much more to the other one than a simpler effect of its joint explains.
bool both_needed(const std::vector<Candidate>& candidates, const Candidate& pair) {
  const auto most = [&](int joint, bool elastic) {
    double gain = 0.0;
    for (const Candidate& c : candidates) {
      if (c.parts.empty() && c.joint == joint && c.is_elastic() == elastic && c.refused.empty() && c.trial.valid)
        gain = std::max(gain, c.trial.cv_gain);
    }
    return gain;
  };
  const auto needed = [&](int joint, int other) {
    return pair.trial.cv_gain - most(other, true) > kMuchMore * most(joint, false);
  };
  const int a = pair.parts[0].joint, b = pair.parts[1].joint;
  return needed(a, b) && needed(b, a);
}

/// Whether an offset leaves as much of a spring as matters: with the offset in place that could not be told from it.
bool leaves_a_spring(const Candidate& c, const Candidate& spring) {
  if (!c.effect.is<Offset>() || !spring.effect.is<Spring>()) return false;
  const double with_spring = spring.trial.joint_after[c.joint], with_offset = c.trial.joint_after[c.joint];
  return 1.0 - std::sqrt(with_spring / std::max(1e-300, with_offset)) > kRelevantGain;
}

/// A spring in one of the joints of a cable and an offset in the other one, which have as many parameters as the cable, where they
/// gain as much; nullptr: there is none. Of different joints gains add up.
/// @param takeable  whether a candidate may be taken
const Candidate* spring_instead_of(const Candidate& cable, const std::vector<Candidate>& candidates,
                                   const std::function<bool(const Candidate&)>& takeable) {
  const auto in = [&](int joint, bool spring) {
    const auto found = std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& c) {
      return c.joint == joint && (spring ? c.effect.is<Spring>() : c.effect.is<Offset>()) && takeable(c);
    });
    return found == candidates.end() ? nullptr : &*found;
  };
  for (const auto& [joint, other] : {std::pair(cable.pair.driving, cable.pair.driven), std::pair(cable.pair.driven, cable.pair.driving)}) {
    const Candidate *spring = in(joint, true), *offset = in(other, false);
    if (spring != nullptr && offset != nullptr && spring->trial.cv_gain + offset->trial.cv_gain > cable.trial.cv_gain) return spring;
  }
  return nullptr;
}

}  // namespace

const Candidate* Rules::simplest(const std::vector<Candidate>& candidates, const Candidate* best,
                                 const Round& round) const {
  if (!best->parts.empty() && !both_needed(candidates, *best)) {
    const auto single = std::find_if(candidates.begin(), candidates.end(),
                                     [&](const Candidate& c) { return c.parts.empty() && objection(c, round).empty(); });
    if (single == candidates.end()) return best;
    best = &*single;
  }
  const Candidate* simple = best;
  for (const Candidate& c : candidates) {
    if (!of_its_joints(c, *best) || c.effect.is<Contact>() || best->effect.is<Contact>()) continue;
    const double least = best->effect.is<FrictionCurve>() ? kFormula : kSimpler;
    if (parameters_of(c) >= parameters_of(*simple) || c.trial.cv_gain < least * best->trial.cv_gain) continue;
    // What a cable explains of its other joint is no reason to take it for an effect of this one.
    const bool same = !c.effect.is<Cable>() || main_joint_of(c.trial) == main_joint_of(best->trial);
    if (same && objection(c, round).empty() && !leaves_a_spring(c, *best)) simple = &c;
  }
  if (simple->effect.is<Cable>()) {
    const auto takeable = [&](const Candidate& c) { return objection(c, round).empty(); };
    if (const Candidate* spring = spring_instead_of(*simple, candidates, takeable)) return spring;
  }
  return simple;
}

}  // namespace heft::diagnose
