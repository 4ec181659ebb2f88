#include "veto.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "arm_search.hpp"
#include "heft/host/parallel.hpp"
#include "intervals.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Errors of one model on the validation logs.
struct Errors {
  std::vector<VectorXd> each;  ///< rms, n each
  std::vector<validate::Score> in_band;
};

/// A joint whose error on a validation log is above that of the fit without effects.
struct Worse {
  Index joint{-1};  ///< -1: there is none
  std::size_t run{0};
};

Worse joint_made_worse(const std::vector<VectorXd>& at_first, const std::vector<VectorXd>& after) {
  Worse found;
  double most = kMayRise;
  for (std::size_t r = 0; r < after.size(); ++r) {
    Index joint = 0;
    const VectorXd rise = (after[r].array() / at_first[r].array().max(1e-300)).matrix();
    if (!(rise.maxCoeff(&joint) - 1.0 > most)) continue;
    most = rise[joint] - 1.0;
    found = {joint, r};
  }
  return found;
}

/// Effects of which nothing has to be done, for as long as what was found of them holds.
class Settled {
 public:
  explicit Settled(Search& search) : search_(search) {}
  bool has(std::size_t effect) const {
    const Engine& engine = search_.engine();
    const std::shared_ptr<const Present> now = search_.present();
    return std::any_of(found_.begin(), found_.end(),
                       [&](const Checked& found) { return still_holds(found, engine.accepted[effect], engine, *now); });
  }
  void add(std::size_t effect) {
    if (!has(effect)) found_.push_back(checked(search_.engine().accepted[effect], search_.present()));
  }

 private:
  Search& search_;
  std::vector<Checked> found_;
};

class Veto {
 public:
  explicit Veto(Search& search) : search_(search), judged_(*search.start().judged), harmless_(search) {}

  void run(const MatrixXd& base) {
    const std::vector<VectorXd> at_first = judged_.rms_errors(base);
    while (!search_.engine().accepted.empty()) {
      const Errors after = errors_of(search_.engine());
      if (!refuse_first(after)) continue;
      const auto [joint, run] = joint_made_worse(at_first, after.each);
      if (joint < 0) return;
      const std::optional<std::size_t> culprit = raises_most(after.each[run][joint], joint, run);
      if (!culprit) return;
      if (!swap_in_held(*culprit, false))
        refuse(*culprit, fmt::format("raises the error of joint {} on {}", joint + 1, judged_.table().runs[run]));
    }
  }

  /// Joints, or -1, where what was taken out explained so much that other effects may have been chosen for it, or not at all.
  const std::set<int>& leaves_much_in() const { return leaves_much_in_; }

 private:
  void refuse(std::size_t effect, const std::string& why) {
    const Candidate& own = search_.engine().accepted[effect];
    constexpr double kMuch = 0.2;  // of its joint's squared error; a spring in a wrong joint hides the one that it stands in for
    if (own.is_elastic() || squared(fall(own.trial).maxCoeff()) > kMuch) leaves_much_in_.insert(own.joint);
    search_.take_out_for_good(effect, why);
  }

  Errors errors_of(const Engine& engine) const {
    const MatrixXd predicted = judged_.predicted(engine.robot());
    return {judged_.rms_errors(predicted), judged_.scores(predicted, search_.start().band)};
  }

  /// Errors without some of the effects, which are fitted at the same time.
  std::vector<Errors> errors_without(const std::vector<std::size_t>& effects) const {
    std::vector<Errors> found(effects.size());
    host::for_each_parallel(effects.size(), [&](std::size_t k) { found[k] = errors_of(*search_.rebuilt_without(effects[k])); });
    return found;
  }

  /// Effect that raises an error of a joint most; none: no effect does.
  std::optional<std::size_t> raises_most(double after, Index joint, std::size_t run) const {
    std::vector<std::size_t> all(search_.engine().accepted.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    const std::vector<Errors> without = errors_without(all);
    std::optional<std::size_t> found;
    double worst = 1.0;
    for (const std::size_t e : all) {
      const double ratio = after / std::max(1e-300, without[e].each[run][joint]);
      if (ratio > worst) worst = ratio, found = e;
    }
    return found;
  }

  /// Takes out the first effect that does harm, or gives it another form.
  /// @return whether none does
  bool refuse_first(const Errors& after) {
    // Most effects do no harm, so that the next ones are fitted without at the same time.
    constexpr std::size_t kTogether = 8;
    const std::size_t count = search_.engine().accepted.size();
    for (std::size_t from = 0; from < count;) {
      std::vector<std::size_t> next;
      for (; from < count && next.size() < kTogether; ++from) {
        if (!harmless_.has(from)) next.push_back(from);
      }
      const std::vector<Errors> without = errors_without(next);
      for (std::size_t k = 0; k < next.size(); ++k) {
        const std::size_t e = next[k];
        const std::string why = harm(search_.engine().accepted[e], after, without[k]);
        if (why.empty()) {
          harmless_.add(e);
          continue;
        }
        if (!take_another_form(e, without[k]) && !swap_in_held(e, true)) refuse(e, why);
        return false;
      }
    }
    return true;
  }

  /// What speaks against an effect by what it does to its own joint, and to all together; empty: nothing.
  std::string harm(const Candidate& own, const Errors& after, const Errors& before) const {
    if (own.effect.is<Contact>()) return {};
    const Index main = main_joint_of(own.trial);
    std::string helps, hurts;
    double squares_after = 0.0, squares_before = 0.0;
    for (std::size_t r = 0; r < after.each.size(); ++r) {
      const VectorXd ratio = after.each[r].array() / before.each[r].array().max(1e-300);
      const double slow =
          after.in_band[r].rmse_in_band[main] / std::max(1e-300, before.in_band[r].rmse_in_band[main]) - 1.0;
      // All joints together: what an effect takes from one joint it may not put on the others.
      const bool bad = ratio[main] > 1.0 || slow > kMayRiseInBand || ratio.array().log().sum() > 0.0;
      (bad ? hurts : helps) = judged_.table().runs[r];
      squares_after += after.each[r][main] * after.each[r][main];
      squares_before += before.each[r][main] * before.each[r][main];
    }
    const bool small = !(fall(own.trial)[main] > relevant_gain(own.trial));
    if (small && !(std::sqrt(squares_after / squares_before) < 1.0 - kRelevantGain)) return kTooSmall;
    if (hurts.empty() && squares_after < squares_before) return {};
    return helps.empty() || hurts.empty() ? "raises the error on the validation logs"
                                          : fmt::format("helps on {} and hurts on {}", helps, hurts);
  }

  /// Against an effect of friction's memory that does harm: another of its forms that does none, the best first. One
  /// such exchange for each joint.
  bool take_another_form(std::size_t effect, const Errors& without) {
    const Candidate own = search_.engine().accepted[effect];
    if (!own.has_memory() || !exchanged_.insert(own.joint).second) return false;
    for (const Candidate& form : search_.forms_of_memory(effect, {own.joint, -1})) {
      if (same_effect(form, own) && std::abs(std::log(form.shape / own.shape)) < 0.05) continue;
      auto tried = search_.rebuilt_without(effect);
      tried->accepted.insert(tried->accepted.begin() + static_cast<std::ptrdiff_t>(effect), own);
      tried->put(effect, form);
      tried->build();
      if (!harm(form, errors_of(*tried), without).empty()) continue;
      const MatrixXd with = judged_.predicted(tried->robot());
      search_.take_over(std::move(tried));
      search_.trace(
          fmt::format("with {} of {:.3g} by {} for {:.3g} by {}", name_of(form), form.shape,
                      displacement_name(form.displacement), own.shape, displacement_name(own.displacement)),
          with);
      return true;
    }
    return false;
  }

  /// Sum over joints of ln(error).
  double judged(const Engine& engine) const {
    return judged_.rms_error(judged_.predicted(engine.robot())).array().log().sum();
  }

  /// Against an effect that a joint pays for: holds weights or masses where that does better than to leave it out.
  /// @param harmless  weights alone, and where it does no harm then: next to held masses no test says what an effect is worth
  bool swap_in_held(std::size_t effect, bool harmless) {
    const Engine& engine = search_.engine();
    double least = judged(*search_.rebuilt_without(effect));
    std::unique_ptr<Engine> best;
    for (const bool masses : {false, true}) {
      if (masses ? engine.masses_held || harmless : engine.weights_held) continue;
      const bool weights_held = engine.weights_held || !masses, masses_held = engine.masses_held || masses;
      auto tried = search_.rebuilt(-1, weights_held, masses_held);
      const double now = judged(*tried);
      if (!(now < least)) continue;
      if (harmless) {
        const auto rest = search_.rebuilt(static_cast<std::ptrdiff_t>(effect), weights_held, masses_held);
        if (!harm(engine.accepted[effect], errors_of(*tried), errors_of(*rest)).empty()) continue;
      }
      least = now;
      best = std::move(tried);
    }
    if (best == nullptr) return false;
    search_.take_over(std::move(best));
    search_.trace(search_.engine().masses_held ? "with the masses of the fit without effects"
                                               : "with the weights of the fit without effects",
                  judged_.predicted(search_.engine().robot()));
    return true;
  }

  Search& search_;
  const JudgedMotion& judged_;
  Settled harmless_;
  std::set<int> exchanged_;       ///< joints whose memory has been given another form
  std::set<int> leaves_much_in_;  ///< see leaves_much_in()
};

/// Whether an effect lowers the error of a joint on validation logs as much as it must.
/// @param steady  left-out blocks of the training logs show it steadily
bool lowers_error(const validate::Score& without, const validate::Score& with, Index joint, bool steady) {
  // Where most of the error is noise of higher frequency: a smaller fall, and a great one in band.
  struct Falls {
    double clear, least, in_band;
  };
  constexpr Falls kUnsteady{0.05, 0.02, 0.2}, kSteady{kRelevantGain, 0.005, 0.1};
  const Falls& asked = steady ? kSteady : kUnsteady;
  const double fall = 1.0 - with.rmse[joint] / without.rmse[joint];
  const double in_band = 1.0 - with.rmse_in_band[joint] / without.rmse_in_band[joint];
  return fall > asked.clear || (fall > asked.least && in_band > asked.in_band);
}

}  // namespace

void reject_needless(Search& search, const Identified& identified) {
  // What left-out blocks show, if not steadily.
  constexpr double kShown = 1.0;
  const JudgedMotion& judged = *search.start().judged;
  const auto fitted = [&](const std::vector<bool>& kept) {
    std::unique_ptr<Engine> engine = identified.with_effects(search.engine(), kept);
    engine->build();
    return engine;
  };
  const auto score = [&](const Engine& engine) {
    return validate::pool(judged.scores(judged.predicted(engine.robot()), search.start().band));
  };
  struct Doubtful {
    std::size_t effect;
    double gain, t;                        ///< on left-out blocks
    std::vector<validate::Score> without;  ///< on the validation logs: without it, and of several springs without any
  };
  Settled needed(search);
  while (true) {
    const std::vector<Candidate>& accepted = search.engine().accepted;
    const std::vector<bool> all(accepted.size(), true);
    std::vector<std::optional<Doubtful>> found(accepted.size());
    // Each of several springs must also show without the others: one may only undo what another one does.
    std::vector<bool> rigid;
    for (const Candidate& e : accepted) rigid.push_back(!e.is_elastic());
    std::optional<validate::Score> without_springs;
    if (std::count(rigid.begin(), rigid.end(), false) > 1) without_springs = score(*fitted(rigid));
    host::for_each_parallel(accepted.size(), [&](std::size_t e) {
      Candidate own = accepted[e];
      const bool paired = search.engine().first_memory(e) >= 0 || search.engine().second_memory(e) >= 0;
      if (identified.own_column(own) >= 0 || own.effect.is<Contact>() || paired || needed.has(e)) return;
      std::vector<bool> rest = all;
      rest[e] = false;
      const std::unique_ptr<Engine> without = fitted(rest);
      if (search.other_spring(e) >= 0) {  // no columns of its own say what it does next to another one
        found[e] = Doubtful{e, own.trial.cv_gain, kSteadyGain, {score(*without), *without_springs}};
        return;
      }
      own.replaces = own.replaces >= 0 ? identified.base->coulomb(own.joint)
                                       : contained_column(own, *identified.base);
      // Where this base holds the motor's inertia in that of the links, no column of it can be judged.
      if (own.has_motor() && own.replaces < 0) remove_motor(own.columns);
      own.stale = true;
      without->judge_again(own);
      // A spring swings with whatever these blocks have in common, touches for one: it must matter on the validation logs too.
      if (own.trial.valid && own.trial.cv_t > kSteadyGain && !own.is_elastic()) return;
      // This base explains a part of it, as masses and a rotor explain the constant part of a spring that weight acts along:
      // what the rest does the fits with it and without it say.
      if (!own.trial.valid) own.trial.cv_gain = accepted[e].trial.cv_gain, own.trial.cv_t = kSteadyGain;
      found[e] = Doubtful{e, own.trial.cv_gain, own.trial.cv_t, {score(*without)}};
    });
    std::erase_if(found, [](const auto& one) { return !one.has_value(); });
    if (found.empty()) return;
    const validate::Score with_all = score(*fitted(all));
    std::erase_if(found, [&](const auto& one) {
      const Candidate& own = accepted[one->effect];
      const Index main = search.other_spring(one->effect) < 0 ? main_joint_of(own.trial) : own.joint;
      return one->t > kShown && std::all_of(one->without.begin(), one->without.end(), [&](const validate::Score& without) {
        return lowers_error(without, with_all, main, one->t > kSteadyGain);
      });
    });
    for (std::size_t e = 0; e < accepted.size(); ++e) {
      if (std::none_of(found.begin(), found.end(), [e](const auto& one) { return one->effect == e; })) needed.add(e);
    }
    // One at a time, the least gain first: what makes an effect needless may be another one that is.
    const auto least = std::min_element(found.begin(), found.end(),
                                        [](const auto& a, const auto& b) { return a->gain < b->gain; });
    if (least == found.end()) return;
    const int joint = accepted[(*least)->effect].joint;
    search.take_out((*least)->effect, (*least)->t > kSteadyGain
                                          ? kShownTooLittle
                                          : "rotor inertia and offsets, which the identified model has anyway, explain it as well");
    if (joint >= 0) search.take_rotor_and_offset(joint, identified);
  }
}

void reject_denied_by_intervals(Search& search, const Identified& identified) {
  const auto denied = [](const Engine& engine, std::size_t e, const std::vector<Replica>& replicas) -> std::string {
    const Candidate& own = engine.accepted[e];
    Finding f(own.effect);
    describe(own, engine.coefficients(e), engine.robot(), f);
    const std::vector<double> half = half_widths_of(own, e, replicas, f.parameters, 1.0 / engine.table().logged_rate);
    if (own.effect.is<TorqueScale>()) {
      if (!(std::abs(f.parameters[0].second) < half[0])) return {};
      return "its 95 % interval contains zero: masses explain it as well";
    }
    // Least part of critical damping that the intervals allow: ζ = D / (2 √(K M))
    const double damping = 0.5 * (own.second - half[1]) / std::sqrt((own.shape + half[0]) * own.inertia);
    if (!(damping > kMostDamped)) return {};
    return fmt::format("its damping would be {:.2f} of the critical one or more, which no gear has", damping);
  };
  for (bool again = true; again;) {
    again = false;
    const Engine& engine = search.engine();
    std::vector<Replica> replicas;
    for (std::size_t e = 0; e < engine.accepted.size() && !again; ++e) {
      const int joint = engine.accepted[e].joint;
      const bool elastic = engine.accepted[e].is_elastic();
      if (!elastic && !engine.accepted[e].effect.is<TorqueScale>()) continue;
      if (replicas.empty()) replicas = engine.replicas();
      const std::string why = denied(engine, e, replicas);
      if (why.empty()) continue;
      search.take_out(e, why);
      if (elastic) search.take_rotor_and_offset(joint, identified);
      again = true;
    }
  }
}

void reject_overfitted(Search& search, const MatrixXd& base) {
  std::set<int> checked;
  while (true) {
    Veto veto(search);
    veto.run(base);
    if (veto.leaves_much_in().empty()) return;
    // What was chosen next to an effect that is out may not be what does best without it.
    bool changed = false;
    for (const int joint : veto.leaves_much_in()) {
      if (checked.insert(joint).second) changed = search.check_again(joint) || changed;
    }
    const std::size_t had = search.engine().accepted.size();
    search.forward(false);
    if (search.engine().accepted.size() > had) {
      search.backward();
    } else if (!changed) {
      return;
    }
  }
}

}  // namespace heft::diagnose
