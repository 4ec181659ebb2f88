#include "findings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "heft/host/parallel.hpp"
#include "intervals.hpp"
#include "residual_structure.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Parameters of an explanation that was not taken, as it was fitted in the place of the one that was.
Rival rival_of(const Candidate& candidate, const model::Robot& robot, int tried) {
  VectorXd c = candidate.trial.coefficients;
  // Its first coefficient is of the deflection, which the shape says as well; the second is the motor's inertia.
  if (candidate.is_elastic()) c = c.tail(std::max<Index>(0, c.size() - 1)).eval();
  Finding described(candidate.effect);
  describe(candidate, c, robot, described);
  return {candidate.effect, candidate.joint, bic_of(candidate, tried), std::move(described.parameters),
          described.driven_joint};
}

/// Other explanations of the same joint, or of the whole arm; of a torque scale those of other joints.
/// @param gain  of the effect taken
void add_rivals(const Candidate& own, double gain, const std::vector<Candidate>& candidates, int tried,
                const model::Robot& robot, Finding& f) {
  for (const Candidate& c : candidates) {
    const bool scales = own.effect.is<TorqueScale>() && c.effect.is<TorqueScale>();
    const bool elsewhere = c.joint >= 0 && own.joint >= 0 && c.joint != own.joint && !scales;
    if (same_place(c, own) || elsewhere || !c.parts.empty() || !c.trial.valid || !c.refused.empty() || c.effect.is<Contact>())
      continue;
    // An effect comes in several forms, the best first; it is a rival once.
    const auto listed = [&](const Rival& r) { return r.effect == c.effect && r.joint == c.joint; };
    if (std::any_of(f.rivals.begin(), f.rivals.end(), listed) ||
        std::any_of(f.equivalent.begin(), f.equivalent.end(), listed)) {
      continue;
    }
    if (c.trial.cv_gain > kEquivalent * gain) {
      f.equivalent.push_back(rival_of(c, robot, tried));
    } else if (c.trial.cv_gain > kRival * gain) {
      f.rivals.push_back(rival_of(c, robot, tried));
    }
  }
}

/// Where a joint's rows that count lie.
std::optional<SeenRange> seen_of(const WrittenModel& written, int joint) {
  if (joint < 0 || !(written.engine().keep().col(joint).maxCoeff() > 0.0)) return {};
  const auto [velocity, load, position, temperature] = written.seen(joint);
  SeenRange range{{velocity.low, velocity.high}, {load.low, load.high}, {position.low, position.high}};
  if (written.engine().table().temperature.cols() > 0)
    range.temperature = std::array{temperature.low, temperature.high};
  return range;
}

/// Whether the model that was given has a value for what an effect is.
bool given_has(const model::Robot& given, const Candidate& e) {
  if (e.joint < 0) return false;
  const JointActuation<double>& actuation = given.joints[static_cast<std::size_t>(e.joint)].actuation;
  return (e.effect.is<Offset>() && actuation.friction_offset != 0.0) ||
         (e.effect.is<RotorInertia>() && actuation.rotor_inertia != 0.0);
}

/// Whether an effect shows in each half of the blocks: its mean gain is above its standard error there. What is friction's
/// alone at a few reversals gains in few blocks, so more cannot be asked of a half.
std::optional<bool> is_stable(const Candidate& e) {
  if (e.effect.is<Contact>() || e.in_time()) return {};
  constexpr double kClear = 1.0;
  return e.trial.half_t[0] > kClear && e.trial.half_t[1] > kClear;
}

/// Torque that the effect adds on the rows that count.
void put_torque(const Engine& engine, std::size_t index, Finding& f) {
  const MatrixXd torque = engine.effect_torque(index);
  double most = -1.0;
  for (Index j = 0; j < torque.cols(); ++j) {
    const VectorXd counted = torque.col(j).cwiseProduct(engine.keep().col(j));
    const double rows = engine.keep().col(j).sum();
    const double rms = rows > 0.0 ? std::sqrt(counted.squaredNorm() / rows) : 0.0;
    if (!(rms > most)) continue;
    most = rms;
    f.torque_rms = rms;
    f.torque_peak = counted.cwiseAbs().maxCoeff();
    f.torque_joint = static_cast<int>(j);
  }
}

}  // namespace

std::vector<Finding> findings_of(Search& search, const WrittenModel& written) {
  // What is left out of the model written is named all the same, unless it does this to its joint's error there.
  constexpr double kFarWorse = 1.1;
  const Engine& engine = search.engine();
  const JudgedMotion& judged = written.judged();
  const model::Robot robot = written.robot();
  const auto error = [&](const model::Robot& by) { return judged.rms_error(judged.predicted(by)); };
  const VectorXd as_written = error(robot);
  // Models without each effect, or with it, and what would stand in its place: none of them asks for another one.
  std::vector<VectorXd> other_errors(engine.accepted.size());
  std::vector<std::vector<Candidate>> evidence(engine.accepted.size());
  host::for_each_parallel(evidence.size(), [&](std::size_t e) {
    if (given_has(search.start().given, engine.accepted[e])) return;
    other_errors[e] = error(written.with(e, !written.has(e))->robot());
    evidence[e] = search.evidence(e);
    for (Candidate& c : evidence[e]) c.columns = {};
  });
  const model::Robot found = engine.robot();
  const std::vector<Replica> replicas = engine.accepted.empty() ? std::vector<Replica>{} : engine.replicas();
  std::vector<Finding> findings;
  for (std::size_t e = 0; e < engine.accepted.size(); ++e) {
    const Candidate& own = engine.accepted[e];
    if (given_has(search.start().given, own)) continue;
    const VectorXd& other = other_errors[e];
    const std::vector<Candidate>& candidates = evidence[e];
    const int tried = std::max(search.tried(), tried_of(candidates));
    Candidate with_rest = own;  // judged with everything else in place
    bool together = false;  // a spring next to another one is judged with it
    for (const Candidate& c : candidates) {
      if (!holds(c, own) || !c.trial.valid || (together && c.parts.empty())) continue;
      with_rest.trial = c.trial;
      together = !c.parts.empty();
    }
    const Trial& trial = with_rest.trial;
    Finding f(own.effect);
    f.joint = own.joint;
    f.p_value = std::min(1.0, trial.p_value * tried);
    f.delta_bic = bic_of(with_rest, tried);
    Index main = 0;
    f.cross_validated = fall(trial).maxCoeff(&main);
    if (own.effect.is<Contact>()) f.cross_validated = std::numeric_limits<double>::quiet_NaN();
    f.main_joint = static_cast<int>(main);
    f.validate_before = (written.has(e) ? other : as_written)[main];
    f.validate_after = (written.has(e) ? as_written : other)[main];
    const double times = f.validate_after / f.validate_before;
    if (!written.has(e) && times > kFarWorse) {
      // It lowers what the search's low-pass leaves of the motion, and nothing that the motion as anyone derives it shows.
      search.refusals().not_taken(
          own, fmt::format("raises the error of joint {} on the validation logs by {:.0f} % next to the identified model",
                           main + 1, 100.0 * (times - 1.0)));
      continue;
    }
    if (!written.has(e) && own.is_elastic() && times > 1.0 - kRelevantGain) {
      // A spring swings with whatever comes near its frequency, a base that vibrates for one.
      search.refusals().not_taken(own, kShownTooLittle);
      continue;
    }
    f.left_out = written.why_not(e);
    f.stable = is_stable(with_rest);
    f.seen = seen_of(written, own.joint);
    add_rivals(own, trial.cv_gain, candidates, tried, robot, f);
    put_torque(engine, e, f);
    // Not those of the model written: masses held at identify's have taken up a part of the effect.
    describe(own, engine.coefficients(e), found, f);
    if (!engine.shares_memory(e))
      f.half_widths = half_widths_of(own, e, replicas, f.parameters, 1.0 / engine.table().logged_rate);
    f.half_widths.resize(f.parameters.size(), std::numeric_limits<double>::quiet_NaN());
    const std::vector<std::string>& runs = engine.table().runs;
    for (const int run : own.event_runs) {
      if (runs.size() > 1) f.event_logs.push_back(runs[static_cast<std::size_t>(run)]);
    }
    findings.push_back(std::move(f));
  }
  std::stable_sort(findings.begin(), findings.end(),
                   [](const Finding& a, const Finding& b) { return a.delta_bic < b.delta_bic; });
  return findings;
}

std::vector<Unexplained> unexplained_of(const Search& search, const Engine& engine) {
  const MotionTable& table = engine.table();
  const MatrixXd residual = engine.problem().residual();
  const VectorXd noise = white_noise(engine.table(), engine.keep(), engine.problem().residual());
  std::vector<Unexplained> all;
  for (int j = 0; j < table.num_joints; ++j) {
    const double rows = engine.problem().counted()[j];
    if (!(rows > 30.0) || search.rules().is_wrong(j)) continue;
    const double square = residual.col(j).squaredNorm() / rows;
    const double above = 1.0 - noise[j] * noise[j] / square;
    if (!search.traces() && above < kStructured) continue;
    const std::vector<Structure> found = structures(table, engine.keep().col(j), residual.col(j), j);
    search.trace(fmt::format("joint {}: {:.1f} % above noise; {} ({:.3f}); {} ({:.3f})", j + 1, 100.0 * above,
                             found[0].what, found[0].share, found[1].what, found[1].share));
    if (above < kStructured) continue;
    Unexplained u;
    u.joint = j;
    u.what = fmt::format("{:.0f} % of the squared residual is not noise", 100.0 * above);
    if (found.front().share > 0.05) u.what += "; it " + found.front().what;
    u.evidence = {{"rms", std::sqrt(square)}, {"noise_rms", noise[j]}, {"share_above_noise", above}};
    for (std::size_t k = 0; k < std::min<std::size_t>(3, found.size()); ++k) {
      if (found[k].share < 0.05) break;
      u.evidence.emplace_back("share: " + found[k].what, found[k].share);
      if (found[k].frequency > 0.0) u.evidence.emplace_back("frequency_hz", found[k].frequency);
    }
    all.push_back(std::move(u));
  }
  return all;
}

}  // namespace heft::diagnose
