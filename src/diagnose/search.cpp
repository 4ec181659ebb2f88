#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "arm_search.hpp"
#include "effects/contact.hpp"
#include "heft/host/parallel.hpp"
#include "joint_check.hpp"

namespace heft::diagnose {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// "2", or "1+2" of an effect that has parts.
std::string joints_of(const Candidate& c) {
  return c.parts.empty() ? fmt::format("{}", c.joint + 1)
                         : fmt::format("{}+{}", c.parts[0].joint + 1, c.parts[1].joint + 1);
}

}  // namespace

Search::Search(Start& start, const DiagnoseOptions& options) : start_(start), options_(options) {}

void Search::progress(double done) const {
  if (options_.progress) options_.progress("effects", done);
}

void Search::trace(const std::string& line) const {
  if (options_.trace) options_.trace(line);
}

void Search::trace(const std::string& what, const MatrixXd& judged) const {
  if (!options_.trace) return;
  trace(fmt::format("{}: training rms [{:.4f}], validation rms [{:.4f}]", what,
                    fmt::join(start_.train->rms_error(engine().predicted()), " "),
                    fmt::join(start_.judged->rms_error(judged), " ")));
}

void Search::trace_pool(const std::vector<Candidate>& pool, const Rules::Round& round) const {
  if (!options_.trace) return;
  constexpr int kMost = 15;
  int shown = 0;
  for (const Candidate& c : pool) {
    if (!c.trial.valid || shown++ >= kMost) continue;
    trace(
        fmt::format("  {:18s} j{} shape {:.4g} c [{:.4g}] gain {:.0f} t {:.1f} lost {:.2f} wald {:.0f} p {:.1e} fall "
                    "{:.3f} dBIC {:.0f} drift {:.2f} {}",
                    c.effect.id(), joints_of(c), c.shape, fmt::join(c.trial.coefficients, " "),
                    c.trial.cv_gain, c.trial.cv_t, c.trial.lost, c.trial.wald, c.trial.p_value * round.tried,
                    c.trial.joint_before.size() > 0 ? fall(c.trial).maxCoeff() : 0.0, bic_of(c, round.tried),
                    c.trial.drift, rules().objection(c, round)));
  }
}

void Search::check_joints() {
  wrong_joints_ = not_explained(engine().problem(), engine().table());
  for (const NotExplained& u : wrong_joints_) {
    trace(fmt::format("joint {} is not explained: error {:.4g}, on its own {:.4g}, {:.0f} % of its largest",
                      u.joint + 1, u.error, u.alone, 100.0 * u.share_of_largest));
  }
}

/// Which joints are looked at; none given: all but those that are wrong.
std::vector<bool> Search::looked_at(const std::vector<int>& of) const {
  std::vector<bool> joints(static_cast<std::size_t>(start_.robot.num_joints()), of.empty());
  for (const int j : of) joints[static_cast<std::size_t>(j)] = true;
  for (const NotExplained& u : wrong_joints_) joints[static_cast<std::size_t>(u.joint)] = false;
  return joints;
}

/// Adds the spring that gains most together with those of other joints.
/// @return whether there are any
bool Search::add_spring_pairs(const Engine& engine, const std::vector<int>& of, std::vector<Candidate>& pool) const {
  std::erase_if(pool, [](const Candidate& c) { return !c.parts.empty(); });  // of another round
  const auto first = std::find_if(pool.begin(), pool.end(), [](const Candidate& c) {
    return c.is_elastic() && c.refused.empty() && c.trial.valid;
  });
  if (first == pool.end() || !(fall(first->trial).maxCoeff() > kRelevantGain)) return false;
  std::vector<Candidate> pairs = engine.spring_pairs(*first, looked_at(of));
  if (pairs.empty()) return false;
  std::move(pairs.begin(), pairs.end(), std::back_inserter(pool));
  sort_by_gain(pool);
  return true;
}

/// Candidates of some joints and of the whole arm; no joints: of all.
std::vector<Candidate> Search::propose(const Engine& engine, const std::vector<int>& of,
                                       const std::function<void(double)>& done, double least) const {
  std::vector<Candidate> candidates = engine.propose(looked_at(of), done, least);
  sort_by_gain(candidates);
  return candidates;
}

/// Finds candidates again of one joint, or of all that have changed since theirs were found, and of the whole arm.
/// @param again     the joint; -1: all
/// @param found_by  n: model by which the candidates of each joint were found
void Search::find_again(int again, std::vector<std::shared_ptr<const Present>>& found_by, std::vector<Candidate>& pool,
                        const std::function<void(double)>& done) {
  const std::shared_ptr<const Present> now = present();
  std::vector<bool> joints = looked_at(again < 0 ? std::vector<int>{} : std::vector{again});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto joint = static_cast<int>(j);
    if (again < 0 && found_by[j] != nullptr && hardly_changed(engine().problem(), *found_by[j], *now, joint)) joints[j] = false;
    if (joints[j]) found_by[j] = now;
  }
  std::erase_if(pool, [&](const Candidate& c) { return c.joint < 0 || joints[static_cast<std::size_t>(c.joint)]; });
  for (Candidate& c : pool) c.stale = true;
  for (Candidate& c : engine().propose(joints, done, 0.0)) pool.push_back(std::move(c));
}

double Search::forward(bool may_stop) {
  std::vector<Candidate> pool;
  std::vector<std::shared_ptr<const Present>> found_by(static_cast<std::size_t>(start_.robot.num_joints()));
  int again = -1;  // joint whose candidates have to be found again; -1: all
  for (auto round = static_cast<int>(engine().accepted.size()); round < options_.most_effects;) {
    const bool fresh = again < 0;
    const double from = round / (round + 2.0), to = (round + 1.0) / (round + 3.0);
    find_again(again, found_by, pool, [&](double part) { progress(kForward * (from + (to - from) * part)); });
    sort_by_gain(pool);
    const VectorXd noise = engine().noise_floor();
    Rules::Round now{tried_of(pool), noise, engine().accepted, gained_once_more(pool, engine().accepted)};
    const Candidate* best = best_of(pool, now);
    if (best != nullptr && judge_simpler_again(pool, *best)) best = best_of(pool, now);
    const bool spring = best == nullptr ? fresh : rules().simplest(pool, best, now)->is_elastic();
    if (spring && add_spring_pairs(engine(), {}, pool)) {
      now.tried = tried_of(pool);
      best = best_of(pool, now);
    }
    tried_ = std::max(tried_, now.tried);
    if (fresh) {
      refusals_.begin_round();
      for (const Candidate& c : pool) refusals_.not_taken(c, rules().objection(c, now));
    }
    trace_pool(pool, now);
    if (best == nullptr) {
      if (fresh) return 0.0;
      again = -1;  // one last look at everything
      continue;
    }
    const Candidate taken = pair_for(*rules().simplest(pool, best, now), pool);
    take(taken);
    if (const double least = taken.is_elastic() && may_stop ? cutoff_for_springs() : 0.0; least > 0.0) return least;
    again = taken.effect.joint_effect() >= 0 ? taken.joint : -1;
    ++round;
  }
  notes_.push_back(
      fmt::format("stopped at {} effects; the residual may contain more", options_.most_effects));
  return 0.0;
}

/// A spring may stand in for two, of which a search along rigid joints sees one: where fits of both leave much less, it is two.
Candidate Search::pair_for(const Candidate& spring, const std::vector<Candidate>& pool) const {
  constexpr double kMuchLess = 0.01;  // of ln(squared error), over the rows of all joints
  if (!spring.is_elastic() || !spring.parts.empty()) return spring;
  const auto pair = std::find_if(pool.begin(), pool.end(), [&](const Candidate& c) {
    return !c.parts.empty() && holds(c, spring) && c.refused.empty() && c.trial.valid;
  });
  if (pair == pool.end()) return spring;
  const auto left_with = [&](const std::vector<Candidate>& springs) {
    const std::unique_ptr<Engine> tried = rebuilt(-1, engine().weights_held, engine().masses_held);
    for (const Candidate& c : springs) tried->put(tried->accepted.size(), c);
    tried->build();
    tried->tune();
    return tried->mean_log_error();
  };
  // What a simpler effect of the other joint does is none of its spring.
  std::vector<Candidate> one{spring};
  const int other = pair->parts[0].joint == spring.joint ? pair->parts[1].joint : pair->parts[0].joint;
  const auto simple = std::find_if(pool.begin(), pool.end(), [&](const Candidate& c) {
    return c.joint == other && !c.is_elastic() && c.refused.empty() && c.trial.valid && !c.stale;
  });
  if (simple != pool.end()) one.push_back(*simple);
  const double fall = left_with(one) - left_with(pair->parts);
  trace(fmt::format("{} instead of {}: {:.4f}", name_of(*pair), name_of(spring), fall));
  return fall > kMuchLess ? *pair : spring;
}

/// A cut-off that lets the swings of springs pass, or as much of them as the noise allows, where one was chosen without them that
/// does not; 0: none.
double Search::cutoff_for_springs() const {
  constexpr double kPasses = 3.0;  // times the frequency: 1 % of a swing is lost
  constexpr double kLeast = 1.5;   // times it, or nothing is gained
  // Rise of ln(rms error) of a joint without effects: noise, and what of the swing itself is left there.
  constexpr double kAllowed = 0.2;
  double wanted = 0.0;
  for (const Candidate& e : engine().accepted) {
    if (e.is_elastic()) wanted = std::max(wanted, kPasses * std::sqrt(e.shape / e.inertia) / (2.0 * std::numbers::pi));
  }
  const std::map<double, double>& tried = start_.residual_behind;
  const auto present = tried.find(start_.cutoff);
  if (wanted <= start_.cutoff || present == tried.end()) return 0.0;
  auto found = tried.lower_bound(wanted);
  if (found == tried.end()) --found;
  while (found->first > start_.cutoff && found->second - present->second > kAllowed * start_.robot.num_joints()) --found;
  if (found->first <= start_.cutoff || found->first < kLeast / kPasses * wanted) return 0.0;
  trace(fmt::format("springs swing at {:.3g} Hz: again behind {:.3g} Hz", wanted / kPasses, found->first));
  return found->first;
}

/// The best that nothing speaks against; candidates judged before another effect was taken are judged again when their
/// turn comes.
const Candidate* Search::best_of(std::vector<Candidate>& pool, const Rules::Round& round) const {
  for (std::size_t k = 0; k < pool.size();) {
    const bool good = rules().objection(pool[k], round).empty();
    if (good && !pool[k].stale) return &pool[k];
    if (good) {
      engine().judge_again(pool[k]);
      sort_by_gain(pool);  // its place may be another one now
    } else {
      ++k;
    }
  }
  return nullptr;
}

/// Tunes springs and delays. With a spring in place the motor's inertia can be told from that of the link: it becomes the spring's
/// own number, and stays that unless it ends below zero.
void Search::tune() {
  model().tune();
  if (find_motors()) model().tune();
  const std::vector<int> impossible = model().remove_impossible_motors();
  for (const int joint : impossible) trace(fmt::format("motor of joint {} would be negative: removed", joint + 1));
  if (!impossible.empty()) model().tune();
}

/// @return whether there are more motors than before
bool Search::find_motors() {
  bool found = false;
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    Candidate spring = engine().accepted[e];
    if (!spring.is_elastic() || spring.has_motor()) continue;
    Candidate motor = motor_alone(spring.joint, engine().motion().qdd.col(spring.joint));
    engine().judge_again(motor);
    const Trial& trial = motor.trial;
    if (!trial.valid || !(trial.coefficients[0] > 0.0 && trial.p_value < kLevel && trial.cv_gain > 0.0)) continue;
    append_motor(spring.columns, spring.joint, motor.columns.values[0]);
    trace(fmt::format("motor of joint {}: {:.3g}", spring.joint + 1, trial.coefficients[0]));
    model().put(e, std::move(spring));
    model().build();
    found = true;
  }
  return found;
}

/// Judges simpler candidates of the best one's joints with what is in place now, as it was judged. Scales of torques are told
/// apart by masses that joints share, so that what was taken in one joint changes what those of all gain: they are judged together.
/// @return whether there are any that were judged before another effect was taken
bool Search::judge_simpler_again(std::vector<Candidate>& pool, const Candidate& best) const {
  const int parameters = parameters_of(best);
  std::vector<Candidate*> again;
  for (Candidate& c : pool) {
    const bool simpler = of_its_joints(c, best) && parameters_of(c) < parameters;
    if (c.stale && (simpler || (c.effect.is<TorqueScale>() && best.effect.is<TorqueScale>()))) again.push_back(&c);
  }
  host::for_each_parallel(again.size(), [&](std::size_t k) { engine().judge_again(*again[k]); });
  if (!again.empty()) sort_by_gain(pool);
  return !again.empty();
}

void Search::take_springs_of(const Search& other) {
  if (other.engine().table().rows() != engine().table().rows()) return;  // their columns begin with the motion there
  for (const Candidate& e : other.engine().accepted) {
    if (e.is_elastic()) model().put(model().accepted.size(), e);
  }
  model().build();
  tune();
  trace("with the springs found before", start_.judged->predicted(engine().robot()));
  if (!wrong_joints_.empty()) check_joints();
}

void Search::take(const Candidate& candidate) {
  std::vector<Candidate>& accepted = model().accepted;
  const auto touched = std::find_if(accepted.begin(), accepted.end(),
                                    [](const Candidate& e) { return e.effect.is<Contact>(); });
  if (candidate.effect.is<Contact>() && touched != accepted.end()) {
    add_touches(candidate, *touched);
  } else if (!candidate.parts.empty()) {
    for (const Candidate& part : candidate.parts) model().put(accepted.size(), part);
  } else {
    model().put(accepted.size(), candidate);
  }
  model().build();
  if (candidate.is_elastic() || candidate.effect.is<Delay>()) tune();
  find_memory_again(candidate.joint);
  if (!candidate.effect.is<PayloadChange>()) find_load_change_again();
  trace("with " + name_of(candidate), start_.judged->predicted(engine().robot()));
  // What was out of reach may be explained now.
  if (!wrong_joints_.empty()) check_joints();
}

/// The time of a change of load was found before another effect was in place. What is left of a wrong one looks like a push.
void Search::find_load_change_again() {
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    Candidate own = engine().accepted[e];
    if (!own.effect.is<PayloadChange>()) continue;
    const std::unique_ptr<Engine> rest = rebuilt_without(e);
    own.stale = true;
    rest->judge_again(own);
    for (Candidate& c : rest->forms_of(own)) {
      if (!c.refused.empty() || !c.trial.valid || c.shape == own.shape || !(c.trial.cv_gain > own.trial.cv_gain)) continue;
      trace(fmt::format("{}: at {:.4g} s now, was at {:.4g} s", name_of(own), c.shape, own.shape));
      model().put(e, std::move(c));
      model().build();
    }
  }
}

/// What a joint's friction remembers was found before another effect of that joint was in place, or next to one that
/// backward checks have taken out.
void Search::find_memory_again(int joint) {
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    const Candidate& own = engine().accepted[e];
    // The first of two comes with the second.
    if (own.joint != joint || !own.has_memory() || engine().second_memory(e) >= 0) continue;
    std::vector<Candidate> forms = forms_of_memory(e, {own.joint});
    if (forms.empty()) continue;
    trace(fmt::format("{}: {:.3g} by {} now, was {:.3g} by {}", name_of(own), forms[0].shape,
                      displacement_name(forms[0].displacement), own.shape,
                      displacement_name(own.displacement)));
    model().put(e, std::move(forms[0]));
    model().build();
  }
}

std::vector<Candidate> Search::forms_of_memory(std::size_t effect,
                                               std::initializer_list<int> standing) const {
  std::vector<Candidate> forms;
  for (const int joint : standing) {
    const auto rest =
        rebuilt(static_cast<std::ptrdiff_t>(effect), engine().weights_held, engine().masses_held, joint);
    for (Candidate& c : rest->forms_of(engine().accepted[effect])) {
      if (c.refused.empty() && c.trial.valid) forms.push_back(std::move(c));
    }
  }
  sort_by_gain(forms);
  return forms;
}

std::unique_ptr<Engine> Search::rebuilt_without(std::size_t index) const {
  return rebuilt(static_cast<std::ptrdiff_t>(index), engine().weights_held, engine().masses_held);
}

std::unique_ptr<Engine> Search::rebuilt(std::ptrdiff_t without, bool weights_held, bool masses_held,
                                        int standing_counts, std::ptrdiff_t and_without) const {
  auto other = std::make_unique<Engine>(engine().base_fit());
  other->weights_held = weights_held;
  other->masses_held = masses_held;
  other->no_springs_in = engine().no_springs_in;
  other->standing_counts = standing_counts;
  for (std::size_t e = 0; e < engine().accepted.size(); ++e) {
    const auto own = static_cast<std::ptrdiff_t>(e);
    if (own != without && own != and_without && (without < 0 || engine().first_memory(e) != without))
      other->accepted.push_back(engine().accepted[e]);
  }
  other->begin_near(engine(), 2);
  other->build();
  return other;
}

std::vector<Candidate> Search::evidence(std::size_t effect) {
  const Evidence* kept = evidence_.of(engine(), *present(), effect);
  return kept != nullptr ? kept->candidates : found_without(effect).candidates;
}

void Search::take_over(std::unique_ptr<Engine> other) {
  present_.reset();
  start_.engine = std::move(other);
}

void Search::take_out_for_good(std::size_t effect, const std::string& why) {
  const Candidate& own = engine().accepted[effect];
  if (own.is_elastic()) {
    model().no_springs_in.push_back(own.joint);
  } else {
    refused_.push_back(own);
    refused_.back().columns = {};
  }
  take_out(effect, why);
}

void Search::take_out(std::size_t effect, const std::string& why) {
  const Candidate own = engine().accepted[effect];
  const double share = own.trial.joint_before.size() > 0 ? squared(fall(own.trial).maxCoeff()) : 0.0;
  refusals_.taken_out(own, why, share);
  model().accepted.erase(model().accepted.begin() + static_cast<std::ptrdiff_t>(effect));
  model().build();
  trace("without " + name_of(own), start_.judged->predicted(engine().robot()));
}

void Search::take_rotor_and_offset(int joint, const Identified& identified) {
  while (true) {
    std::vector<Candidate> pool = propose(engine(), {joint});
    const VectorXd noise = engine().noise_floor();
    const Rules::Round now{std::max(tried_, tried_of(pool)), noise, engine().accepted};
    std::erase_if(pool, [&](const Candidate& c) { return c.joint != joint || identified.own_column(c) < 0; });
    const Candidate* best = best_of(pool, now);
    if (best == nullptr) return;
    take(Candidate(*best));
  }
}

}  // namespace heft::diagnose
