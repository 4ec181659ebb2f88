#include "heft/diagnose/diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "arm_search.hpp"
#include "engine.hpp"
#include "heft/host/error.hpp"
#include "heft/model/motion_torque.hpp"
#include "joint_check.hpp"
#include "residual_structure.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What an effect must show to be taken ---------------------------------------------------------------------

/// Chance that noise alone looks like this, all candidates together.
constexpr double kLevel = 1e-3;
/// Mean gain on left-out blocks against its standard error.
constexpr double kSteadyGain = 2.5;
/// Least fall of the rms error on left-out blocks in the joint where it shows most.
constexpr double kSizeThatMatters = 0.02;
/// The same when three or more runs all gain from it.
constexpr double kSizeInRuns = 0.01;
/// Least part of what stands above the noise that it must explain there.
constexpr double kShareThatNames = 0.2;
/// The same when three or more runs all gain from it.
constexpr double kShareInRuns = 0.05;
/// Most that its coefficient may differ in a quarter of the time, in parts of it.
constexpr double kHolds = 0.6;
/// Shortest time constant of a joint that warms up [s].
constexpr double kQuickestWarming = 3.0;
/// A simpler effect on the same joint with this part of the gain goes before.
constexpr double kSimpler = 0.95;
/// Most that all effects may raise the error of a joint on a validation log.
constexpr double kMayRise = 0.02;
/// Most that it may raise its own joint's error in band there: what is bought with the slow part of the torque
/// mends the derived motion rather than the model.
constexpr double kMayRiseInBand = 0.05;
/// A residual that stands this much above noise (squared errors) has structure.
constexpr double kStructured = 0.1;
/// Rivals within this part of an effect's gain are listed; within the second they explain the same.
constexpr double kRival = 0.3, kEquivalent = 0.97;

/// Fall of the rms error on left-out blocks, by joint.
VectorXd fall(const Trial& trial) {
  VectorXd result = VectorXd::Zero(trial.joint_before.size());
  for (Index j = 0; j < result.size(); ++j) {
    if (trial.joint_before[j] > 0.0) {
      result[j] = 1.0 - std::sqrt(std::max(0.0, trial.joint_after[j]) / trial.joint_before[j]);
    }
  }
  return result;
}

int parameters_of(const Candidate& c) {
  // Of an event begin and length are chosen as well as its force.
  return static_cast<int>(c.trial.coefficients.size() + 2 * c.events.size()) + (c.tried > 1 ? 1 : 0);
}

/// Robust chi-square of the coefficients against what they cost.
double bic_of(const Candidate& c, int candidates) {
  return -c.trial.wald + parameters_of(c) * std::log(std::max(2.0, c.trial.effective_rows)) +
         2.0 * std::log(std::max(1.0, static_cast<double>(candidates)));
}

int tried_of(const std::vector<Candidate>& candidates) {
  int tried = 0;
  for (const Candidate& c : candidates) tried += c.tried;
  return tried;
}

/// The same effect in the same place, and in the same form.
bool same_effect(const Candidate& a, const Candidate& b) {
  return same_place(a, b) && (a.replaces >= 0) == (b.replaces >= 0) && a.displacement == b.displacement &&
         a.beside == b.beside;
}

std::string name_of(const Candidate& c) {
  return c.joint >= 0 ? fmt::format("{} on joint {}", c.effect.id(), c.joint + 1)
                      : std::string(c.effect.id());
}

std::vector<data::MotionStream> streams_of(const std::vector<data::Log>& logs, double cutoff) {
  std::vector<data::MotionStream> streams;
  data::StreamOptions options;
  options.motion.cutoff = cutoff;
  options.motion.smooth_position = true;
  options.prefer_logged = false;
  options.displacement = true;
  options.cut_standstill = false;  // tables tell standstill apart
  for (const data::Log& log : logs) streams.emplace_back(log, options);
  return streams;
}

MotionTable table_of(const model::Robot& robot, const std::vector<data::MotionStream>& streams) {
  std::vector<const data::MotionStream*> list;
  for (const auto& s : streams) list.push_back(&s);
  std::vector<bool> prismatic;
  for (const auto& joint : robot.joints) prismatic.push_back(joint.joint.type == JointType::kPrismatic);
  TableOptions options;
  double seconds = 0.0;
  for (const data::MotionStream* log : list) seconds += log->summary().end - log->summary().begin;
  // Long blocks hold what is correlated together; a short log needs enough of them.
  options.block_seconds = std::clamp(seconds / 30.0, 0.15, 1.0);
  return make_table(list, prismatic, options);
}

/// Scores of the logs of a table, and their residuals for plots.
std::vector<validate::Score> score_table(const MotionTable& table,
                                         const std::vector<data::MotionStream>& streams,
                                         const MatrixXd& predicted, double band) {
  std::vector<validate::Score> scores;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    const Index begin = table.run_begin[r], count = table.run_begin[r + 1] - begin;
    const data::StreamSummary& summary = streams[r].summary();
    validate::TorqueScorer::Setup setup;
    setup.log = summary.path;
    setup.begin = table.time[begin];
    setup.end = table.time[begin + count - 1];
    setup.samples = count;
    setup.max_torque = summary.max_torque;
    setup.sample_rate = static_cast<double>(count - 1) / (setup.end - setup.begin);
    setup.band = band;
    setup.moving_from = summary.moving_from - summary.begin;
    setup.moving_to = summary.moving_to - summary.begin;
    validate::TorqueScorer scorer(setup);
    scorer.add_rows(table.time.segment(begin, count), table.tau.middleRows(begin, count),
                    predicted.middleRows(begin, count));
    scorer.add_grid(table.time.segment(begin, count),
                    table.tau.middleRows(begin, count) - predicted.middleRows(begin, count));
    scores.push_back(scorer.finish());
  }
  return scores;
}

MatrixXd predicted_by(const MotionTable& table, const model::Robot& robot) {
  model::MotionTorque torque(robot);
  MatrixXd predicted(table.rows(), table.num_joints);
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    const Index begin = table.run_begin[r], count = table.run_begin[r + 1] - begin;
    const double width = table.sign_width.maxCoeff();
    const VectorXd time = table.time.segment(begin, count);
    const MatrixXd q = table.q.middleRows(begin, count), qd = table.qd.middleRows(begin, count),
                   qdd = table.qdd.middleRows(begin, count);
    torque.start_from(time, q, qd, qdd, table.tau.middleRows(begin, count), width);
    predicted.middleRows(begin, count) =
        torque.torque(time, q, qd, qdd, width, table.displacement.middleRows(begin, count));
  }
  return predicted;
}

/// Rms error of one log of a table over all rows but 0.5 s at the ends, n.
VectorXd rms_error(const MotionTable& table, std::size_t run, const MatrixXd& predicted) {
  VectorXd sum = VectorXd::Zero(table.num_joints);
  double count = 0.0;
  const Index last = table.run_begin[run + 1] - 1;
  for (Index i = table.run_begin[run]; i <= last; ++i) {
    if (table.time[i] < validate::kScoreEnd || table.time[last] - table.time[i] < validate::kScoreEnd)
      continue;
    sum += (table.tau.row(i) - predicted.row(i)).cwiseAbs2().transpose();
    count += 1.0;
  }
  return (sum / std::max(1.0, count)).cwiseSqrt();
}

std::vector<VectorXd> rms_errors(const MotionTable& table, const MatrixXd& predicted) {
  std::vector<VectorXd> errors;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r)
    errors.push_back(rms_error(table, r, predicted));
  return errors;
}

/// The same of all logs together, each counting as much as another.
VectorXd pooled(const std::vector<VectorXd>& errors) {
  VectorXd squares = VectorXd::Zero(errors.front().size());
  for (const VectorXd& e : errors) squares += e.cwiseAbs2() / static_cast<double>(errors.size());
  return squares.cwiseSqrt();
}

VectorXd rms_error(const MotionTable& table, const MatrixXd& predicted) {
  return pooled(rms_errors(table, predicted));
}

/// Rigid bodies, Coulomb and viscous friction of an arm; what else its model holds is what is looked for.
/// @param taken_out  what that was
model::Robot bare(model::Robot robot, std::vector<std::string>& taken_out) {
  for (const JointEffect<double>& effect : robot.effects) {
    std::string id;
    visit_joint_effect(effect.kind, [&](auto type) { id = std::string(decltype(type)::kId); });
    std::replace(id.begin(), id.end(), '_', ' ');
    taken_out.push_back(fmt::format("{} in joint {}", id, effect.joint + 1));
  }
  for (const Elasticity<double>& elasticity : robot.elasticities)
    taken_out.push_back(fmt::format("elasticity in joint {}", elasticity.joint + 1));
  for (const GearCoupling<double>& coupling : robot.couplings)
    taken_out.push_back(
        fmt::format("coupling of joints {} and {}", coupling.driving + 1, coupling.driven + 1));
  if (robot.torque_delay > 0.0) taken_out.push_back("delay of the torque channel");
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    JointActuation<double>& actuation = robot.joints[j].actuation;
    if (actuation.rotor_inertia != 0.0) taken_out.push_back(fmt::format("rotor inertia in joint {}", j + 1));
    if (actuation.friction_offset != 0.0) taken_out.push_back(fmt::format("offset in joint {}", j + 1));
    actuation.rotor_inertia = actuation.friction_offset = 0.0;
  }
  robot.effects.clear();
  robot.elasticities.clear();
  robot.couplings.clear();
  robot.torque_delay = 0.0;
  return robot;
}

/// Pairs of joints that may share a motor, each once.
std::vector<GearCoupling<double>> pairs_of(const model::Robot& robot, const DiagnoseOptions& options) {
  constexpr int kWristBends = 4, kWristTurns = 5;
  std::vector<GearCoupling<double>> pairs;
  for (const auto* list : {&options.couplings, &robot.couplings}) {
    for (const GearCoupling<double>& c : *list) {
      const bool known = std::any_of(pairs.begin(), pairs.end(), [&](const GearCoupling<double>& p) {
        return p.driving == c.driving && p.driven == c.driven;
      });
      if (!known) pairs.push_back(c);
    }
  }
  if (pairs.empty() && robot.num_joints() > kWristTurns)
    pairs.push_back({.driving = kWristBends, .driven = kWristTurns});
  return pairs;
}

/// The whole diagnosis while it grows.
class Session {
 public:
  Session(const model::Robot& robot, const std::vector<data::Log>& train,
          const std::vector<data::Log>& validate, const DiagnoseOptions& options)
      : options_(options) {
    std::vector<std::string> taken_out;
    robot_ = bare(robot, taken_out);
    pairs_ = pairs_of(robot, options);
    if (!taken_out.empty()) {
      notes_.push_back(
          fmt::format("the model's own {}: not taken over but looked for anew, since what is missing is told "
                      "against rigid bodies, Coulomb and viscous friction",
                      fmt::join(taken_out, ", ")));
    }
    choose_cutoff(train);
    train_ = streams_of(train, cutoff_);
    judged_ = streams_of(validate, cutoff_);
    judged_table_ = table_of(robot_, judged_);
    train_table_ = table_of(robot_, train_);
    engine_ = std::make_unique<Engine>(robot_, train_table_, pairs_);
    if (!(engine_->problem().counted().maxCoeff() > 0.0)) {
      throw NotIdentifiableError(
          "no joint moves in the training logs; expected a motion in which every joint moves; record one, "
          "for "
          "instance from heft excite");
    }
  }

  Diagnosis run() {
    Diagnosis result;
    result.cutoff = cutoff_;
    result.sign_width = train_table_.sign_width.maxCoeff();
    result.before = engine_->robot();
    const MatrixXd train_before = engine_->predicted();
    const MatrixXd judged_before = predicted_by(judged_table_, result.before);
    trace("base", judged_before);
    forward();
    backward();
    refuse_what_does_not_carry_over(judged_before);
    findings(result);

    result.after = engine_->robot();
    const MatrixXd train_after = engine_->predicted();
    const MatrixXd judged_after = predicted_by(judged_table_, result.after);
    const auto pooled = [&](const MotionTable& table, const std::vector<data::MotionStream>& streams,
                            const MatrixXd& p, std::vector<validate::Score>* each) {
      const std::vector<validate::Score> scores = score_table(table, streams, p, band());
      if (each != nullptr) *each = scores;
      return validate::pool(scores);
    };
    result.train_before = pooled(engine_->table(), train_, train_before, nullptr);
    result.train_after = pooled(engine_->table(), train_, train_after, nullptr);
    result.validate_before = pooled(judged_table_, judged_, judged_before, &result.validate_each_before);
    result.validate_after = pooled(judged_table_, judged_, judged_after, &result.validate_each_after);
    const MatrixXd nothing = MatrixXd::Zero(judged_after.rows(), judged_after.cols());
    result.validate_torque = pooled(judged_table_, judged_, nothing, nullptr);
    result.train = traces(engine_->table(), train_before, train_after);
    result.validate = traces(judged_table_, judged_before, judged_after);
    check_joints();
    result.not_explained = unexplained_joints_;
    unexplained(result);
    std::erase_if(refusals_, [&](const Refusal& r) {
      return std::any_of(result.findings.begin(), result.findings.end(),
                         [&](const Finding& f) { return f.effect == r.effect && f.joint == r.joint; });
    });
    std::stable_sort(refusals_.begin(), refusals_.end(),
                     [](const Refusal& a, const Refusal& b) { return a.gain > b.gain; });
    // What was refused in two forms is told once, as its stronger one.
    std::vector<Refusal> once;
    for (Refusal& r : refusals_) {
      const auto same = [&](const Refusal& o) { return o.effect == r.effect && o.joint == r.joint; };
      if (std::none_of(once.begin(), once.end(), same)) once.push_back(std::move(r));
    }
    result.refusals = std::move(once);
    result.notes = std::move(notes_);
    result.candidates = tried_;
    for (const double s : engine_->table().run_seconds) result.seconds += s;
    return result;
  }

 private:
  void tell(const std::string& what, double done) const {
    if (options_.progress) options_.progress(what, done);
  }
  void trace(const std::string& what, const MatrixXd& judged) const {
    if (!options_.trace) return;
    options_.trace(fmt::format("{}: training rms [{:.4f}], validation rms [{:.4f}]", what,
                               fmt::join(rms_error(engine_->table(), engine_->predicted()), " "),
                               fmt::join(rms_error(judged_table_, judged), " ")));
  }

  /// The cut-off that leaves the smallest residual: a low one loses motion, a high one lets encoder noise in.
  void choose_cutoff(const std::vector<data::Log>& train) {
    double from_motion = 0.0, highest = 0.0;
    for (const data::MotionStream& stream : streams_of(train, 0.0)) {
      if (highest == 0.0) highest = 0.4 * stream.summary().sample_rate;
      from_motion = std::max(from_motion, stream.summary().cutoff);
      bandwidth_ = std::max(bandwidth_, stream.summary().bandwidth);
    }
    cutoff_ = options_.cutoff;
    if (cutoff_ > 0.0) return;
    // Motion that is cut off cannot say what the torque does in the band that was asked for.
    const double lowest = options_.band < highest ? options_.band : 0.0;
    double least = 0.0;
    int step = 0;
    double tried = -1.0;
    for (double hz : {from_motion, 6.0, 12.0, 20.0, 32.0}) {
      tell("motion", 0.05 * step++ / 5.0);  // the effects take the rest of the time
      hz = std::max(hz, lowest);
      if (hz == tried || hz >= highest) continue;
      tried = hz;
      const std::vector<data::MotionStream> streams = streams_of(train, hz > 0.0 ? hz : 5.0);
      const Engine engine(robot_, table_of(robot_, streams), pairs_);
      double logs = 0.0;
      const VectorXd rms = rms_error(engine.table(), engine.predicted());
      for (Index j = 0; j < rms.size(); ++j) logs += std::log(std::max(1e-12, rms[j]));
      if (cutoff_ == 0.0 || logs < least) least = logs, cutoff_ = hz;
    }
    if (!(cutoff_ > 0.0)) cutoff_ = from_motion;
  }

  double band() const { return options_.band > 0.0 ? options_.band : validate::default_band(bandwidth_); }

  /// Why a candidate is not taken; empty: it can be.
  std::string objection(const Candidate& c, int tried, const VectorXd& noise_floor,
                        const std::vector<Candidate>& taken) const {
    if (!c.refused.empty()) return c.refused;
    const auto in_place =
        std::count_if(taken.begin(), taken.end(), [&](const Candidate& e) { return same_place(e, c); });
    if (in_place > (c.beside ? 1 : 0)) return "is in the model already";
    if (!c.trial.valid) return "this motion cannot tell it from the rest of the model";
    if (c.joint >= 0 ? leaves_unexplained(c.joint) : !unexplained_joints_.empty() && !explains_joints(c))
      return "the arm model does not explain this joint";
    if (c.effect.is<FrictionDrift>() && c.shape < kQuickestWarming)
      return "too quick for a joint that warms up";
    if (c.effect.is<Spring>()) {
      const auto q = engine_->table().q.col(c.joint);
      const double slope = std::abs(c.trial.coefficients[0]) * 0.5 * (q.maxCoeff() - q.minCoeff());
      const double middle =
          c.trial.coefficients[0] * 0.5 * (q.maxCoeff() + q.minCoeff()) + c.trial.coefficients[1];
      if (slope < 0.25 * std::abs(middle)) return "is an offset rather than a spring";
    }
    if (options_.joint_sensor && c.effect.is<RotorInertia>())
      return "a sensor behind the gear does not feel the rotor";
    if (!(c.trial.p_value * tried < kLevel)) return "chance explains it";
    if (c.effect.is<Contact>()) return {};
    const bool in_time = c.effect.is<PayloadChange>() || c.effect.is<FrictionDrift>();
    if (!in_time && c.trial.drift > kHolds) return "comes and goes: it is not the same all the time";
    if (!(c.trial.cv_t > kSteadyGain)) return "does not help on stretches that it was not fitted to";
    // Several runs that agree say what one run leaves open.
    const auto& runs = c.trial.run_gain;
    const bool agreed = runs.size() >= kRunsThatAgree && *std::min_element(runs.begin(), runs.end()) > 0.0;
    if (c.beside && !agreed) return "a second distance takes three runs that agree";
    Index main = 0;
    const double size = fall(c.trial).maxCoeff(&main);
    if (!(size > (agreed ? kSizeInRuns : kSizeThatMatters))) return "too small to matter";
    if (c.effect.is<Delay>() && (fall(c.trial).array() > 0.5 * kSizeThatMatters).count() < 2) {
      return "shows in one joint only: a late channel is late for all";
    }
    const double rows = engine_->problem().counted()[main];
    const double floor = rows * noise_floor[main] * noise_floor[main];
    const double above = std::max(1e-300, c.trial.joint_before[main] - floor);
    const double least = agreed ? kShareInRuns : kShareThatNames;
    if ((c.trial.joint_before[main] - c.trial.joint_after[main]) / above < least) {
      return "explains only a small part of what is left there";
    }
    return {};
  }

  void check_joints() {
    unexplained_joints_ = not_explained(engine_->problem(), engine_->table());
    if (!options_.trace) return;
    for (const NotExplained& u : unexplained_joints_) {
      options_.trace(
          fmt::format("joint {} is not explained: error {:.4g}, on its own {:.4g}, {:.0f} % of its largest",
                      u.joint + 1, u.error, u.alone, 100.0 * u.share_of_largest));
    }
  }

  /// Whether the model as it is does not explain a joint. What is left there is no small effect.
  bool leaves_unexplained(int joint) const {
    return std::any_of(unexplained_joints_.begin(), unexplained_joints_.end(),
                       [joint](const NotExplained& u) { return u.joint == joint; });
  }

  /// Whether an effect of the whole arm takes away most of the error of the joint where it shows most, as a wrist
  /// coupling or a tilted base does; events would only follow the error of a joint that nothing explains.
  static bool explains_joints(const Candidate& c) {
    constexpr double kMostOfIt = 0.5;
    return !c.effect.is<Contact>() && !c.effect.is<PayloadChange>() && c.trial.joint_before.size() > 0 &&
           fall(c.trial).maxCoeff() > kMostOfIt;
  }

  /// Candidates of one joint and of the whole arm; joint -1: of all joints.
  std::vector<Candidate> propose(const Engine& engine, int joint, double from, double to) const {
    std::vector<bool> joints(static_cast<std::size_t>(robot_.num_joints()), joint < 0);
    if (joint >= 0) joints[static_cast<std::size_t>(joint)] = true;
    for (const NotExplained& u : unexplained_joints_) joints[static_cast<std::size_t>(u.joint)] = false;
    std::vector<Candidate> candidates =
        engine.propose(joints, [&](double done) { tell("effects", from + (to - from) * done); });
    sort(candidates);
    return candidates;
  }

  static void sort(std::vector<Candidate>& candidates) {
    std::stable_sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.trial.cv_gain > b.trial.cv_gain;
    });
  }

  /// Takes the best candidate as long as there is one that nothing speaks against.
  void forward() {
    std::vector<Candidate> pool;
    int again = -1;  // joint whose candidates have to be found anew; -1: all
    bool fresh = false;
    for (int round = 0; round < options_.most_effects;) {
      fresh = again < 0;
      if (again < 0) {
        pool.clear();
      } else {
        std::erase_if(pool, [&](const Candidate& c) { return c.joint == again || c.joint < 0; });
        for (Candidate& c : pool) c.stale = true;
      }
      for (Candidate& c : propose(*engine_, again, round / (round + 2.0), (round + 1.0) / (round + 3.0))) {
        pool.push_back(std::move(c));
      }
      sort(pool);
      const int tried = tried_of(pool);
      tried_ = std::max(tried_, tried);
      const VectorXd noise = white_noise(engine_->table(), engine_->problem().residual());
      const Candidate* best = nullptr;
      for (std::size_t k = 0; k < pool.size() && best == nullptr;) {
        if (pool[k].stale && objection(pool[k], tried, noise, engine_->accepted).empty()) {
          engine_->judge_again(pool[k]);
          sort(pool);  // its place may be another one now
          continue;
        }
        if (objection(pool[k], tried, noise, engine_->accepted).empty()) best = &pool[k];
        ++k;
      }
      if (fresh) {
        refusals_.clear();  // those of the last full round stand: with everything else in place
        for (const Candidate& c : pool) refuse(c, objection(c, tried, noise, engine_->accepted));
      }
      if (options_.trace) trace_pool(pool, tried, noise);
      if (best == nullptr) {
        if (fresh) return;
        again = -1;  // one last look at everything
        continue;
      }
      best = simplest(pool, best, tried, noise, engine_->accepted);
      const Candidate taken = *best;
      engine_->put(engine_->accepted.size(), taken);
      engine_->build();
      if (taken.effect.is<ElasticJoint>() || taken.effect.is<Delay>()) engine_->tune();
      find_memory_anew(taken.joint);
      trace("with " + name_of(taken), predicted_by(judged_table_, engine_->robot()));
      // What was out of reach may be explained now.
      if (!unexplained_joints_.empty()) check_joints();
      again = taken.effect.joint_effect() >= 0 ? taken.joint : -1;
      ++round;
    }
    notes_.push_back(fmt::format("stopped at {} effects; what is left may hold more", options_.most_effects));
  }

  /// What a joint's friction remembers was found before another effect of that joint was in place, or beside one that
  /// backward checks have taken out.
  void find_memory_anew(int joint) {
    for (std::size_t e = 0; e < engine_->accepted.size(); ++e) {
      Candidate& own = engine_->accepted[e];
      // The first of two comes with the second.
      if (own.joint != joint || !own.has_memory() || engine_->second_memory(e) >= 0) continue;
      std::vector<Candidate> forms = forms_of_memory(e, {own.joint});
      if (forms.empty()) continue;
      if (options_.trace) {
        options_.trace(fmt::format("{}: {:.3g} by {} now, was {:.3g} by {}", name_of(own), forms[0].shape,
                                   displacement_name(forms[0].displacement), own.shape,
                                   displacement_name(own.displacement)));
      }
      engine_->put(e, std::move(forms[0]));
      engine_->build();
    }
  }

  /// Possible forms of a memory, judged with everything else in place, the best first.
  /// @param standing  joints whose standstill counts beside that of the accepted memories, one after the other; see
  ///                  Engine::standing_counts
  std::vector<Candidate> forms_of_memory(std::size_t effect, std::initializer_list<int> standing) const {
    std::vector<Candidate> forms;
    for (const int joint : standing) {
      const auto rest =
          rebuilt(static_cast<std::ptrdiff_t>(effect), engine_->weights_held, engine_->masses_held, joint);
      for (Candidate& c : rest->forms_of(engine_->accepted[effect])) {
        if (c.refused.empty() && c.trial.valid) forms.push_back(std::move(c));
      }
    }
    sort(forms);
    return forms;
  }

  void refuse(const Candidate& c, const std::string& why) {
    if (why.empty() || !c.trial.valid || c.trial.joint_before.size() == 0) return;
    const double size = fall(c.trial).maxCoeff();
    if (size > 0.5 * kSizeThatMatters)
      refusals_.push_back({c.effect, c.joint, why, 1.0 - std::pow(1.0 - size, 2)});
  }

  void trace_pool(const std::vector<Candidate>& pool, int tried, const VectorXd& noise) const {
    int shown = 0;
    for (const Candidate& c : pool) {
      if (!c.trial.valid || shown++ > 14) continue;
      options_.trace(
          fmt::format("  {:18s} j{} shape {:.4g} c [{:.4g}] gain {:.0f} t {:.1f} wald {:.0f} p {:.1e} fall "
                      "{:.3f} dBIC {:.0f} drift {:.2f} {}",
                      c.effect.id(), c.joint + 1, c.shape, fmt::join(c.trial.coefficients, " "),
                      c.trial.cv_gain, c.trial.cv_t, c.trial.wald, c.trial.p_value * tried,
                      c.trial.joint_before.size() > 0 ? fall(c.trial).maxCoeff() : 0.0, bic_of(c, tried),
                      c.trial.drift, objection(c, tried, noise, engine_->accepted)));
    }
  }

  /// A simpler effect that explains as good as the same stands first: what the motion cannot tell apart, and
  /// kinds that contain another one.
  const Candidate* simplest(const std::vector<Candidate>& candidates, const Candidate* best, int tried,
                            const VectorXd& noise, const std::vector<Candidate>& taken) const {
    const Candidate* simple = best;
    for (const Candidate& c : candidates) {
      if (c.joint != best->joint || c.effect.is<Contact>() || best->effect.is<Contact>()) continue;
      if (parameters_of(c) >= parameters_of(*simple) || c.trial.cv_gain < kSimpler * best->trial.cv_gain)
        continue;
      if (objection(c, tried, noise, taken).empty()) simple = &c;
    }
    return simple;
  }

  /// Takes each effect out again: one that another has made needless goes, one that another does better is
  /// exchanged.
  void backward() {
    evidence_.clear();
    for (std::size_t e = 0; e < engine_->accepted.size() && engine_->accepted.size() > 1;) {
      const Candidate& own = engine_->accepted[e];
      // A memory found with its joint's standstill is compared with it as well.
      const std::unique_ptr<Engine> rest = rebuilt(static_cast<std::ptrdiff_t>(e), engine_->weights_held,
                                                   engine_->masses_held, own.has_memory() ? own.joint : -1);
      const Engine& without = *rest;
      std::vector<Candidate> candidates = propose(without, own.joint, 0.9, 0.95);
      const int tried = std::max(tried_, tried_of(candidates));
      const VectorXd noise = white_noise(without.table(), without.problem().residual());
      const Candidate *same = nullptr, *best = nullptr;
      for (const Candidate& c : candidates) {
        if (same_effect(c, own)) same = &c;
        if (best == nullptr && objection(c, tried, noise, without.accepted).empty()) best = &c;
      }
      if (best != nullptr) best = simplest(candidates, best, tried, noise, without.accepted);
      if (own.effect.is<Contact>() || (best != nullptr && best == same)) {
        for (Candidate& c : candidates) c.columns = {};
        evidence_.push_back(std::move(candidates));
        ++e;
        continue;
      }
      evidence_.clear();  // no longer that of the model as it stands
      const int joint = own.joint;
      // A memory was compared in each of its forms above; the first of two takes its own distance again.
      const bool remembers = own.has_memory() && !own.beside;
      if (best == nullptr) {
        refusals_.push_back({own.effect, own.joint, "another effect has made it needless", 0.0});
        engine_->accepted.erase(engine_->accepted.begin() + static_cast<std::ptrdiff_t>(e));
        engine_->build();
        if (!remembers) find_memory_anew(joint);
        continue;
      }
      if (same == nullptr || best->trial.cv_gain > 1.02 * same->trial.cv_gain) {
        if (options_.trace) options_.trace(fmt::format("exchanged {} for {}", name_of(own), name_of(*best)));
        engine_->put(e, *best);
        engine_->build();
        if (!remembers) find_memory_anew(joint);
      }
      ++e;
    }
  }

  std::unique_ptr<Engine> rebuilt_without(std::size_t index) const {
    return rebuilt(static_cast<std::ptrdiff_t>(index), engine_->weights_held, engine_->masses_held);
  }
  /// @param without  effect to leave out; -1: none
  /// @param standing_counts  see Engine
  std::unique_ptr<Engine> rebuilt(std::ptrdiff_t without, bool weights_held, bool masses_held,
                                  int standing_counts = -1) const {
    auto engine = std::make_unique<Engine>(robot_, train_table_, pairs_, engine_->steady());
    engine->weights_held = weights_held;
    engine->masses_held = masses_held;
    engine->standing_counts = standing_counts;
    for (std::size_t e = 0; e < engine_->accepted.size(); ++e) {
      const auto own = static_cast<std::ptrdiff_t>(e);
      if (own != without && (without < 0 || engine_->first_memory(e) != without))
        engine->accepted.push_back(engine_->accepted[e]);
    }
    if (!engine->accepted.empty() || standing_counts >= 0) engine->build();
    return engine;
  }

  /// Sum over joints of ln(error on the validation logs).
  double judged(const Engine& engine) const {
    return rms_error(judged_table_, predicted_by(judged_table_, engine.robot())).array().log().sum();
  }

  /// Against an effect that another joint pays for: holds weights or masses where that does better than to leave it out.
  bool hold_instead(std::size_t effect) {
    double least = judged(*rebuilt_without(effect));
    std::unique_ptr<Engine> best;
    for (const bool masses : {false, true}) {
      if (masses ? engine_->masses_held : engine_->weights_held) continue;
      auto tried = rebuilt(-1, engine_->weights_held || !masses, engine_->masses_held || masses);
      const double now = judged(*tried);
      if (now < least) least = now, best = std::move(tried);
    }
    if (best == nullptr) return false;
    engine_ = std::move(best);
    evidence_.clear();
    trace(engine_->masses_held ? "with the masses of the fit without effects"
                               : "with the weights of the fit without effects",
          predicted_by(judged_table_, engine_->robot()));
    return true;
  }

  /// The validation logs have a veto: an effect that raises the error there goes.
  /// @param base  prediction of the fit without effects
  void refuse_what_does_not_carry_over(const MatrixXd& base) {
    const std::vector<VectorXd> at_first = rms_errors(judged_table_, base);
    while (!engine_->accepted.empty()) {
      const MatrixXd with = predicted_by(judged_table_, engine_->robot());
      const std::vector<VectorXd> after = rms_errors(judged_table_, with);
      const std::vector<validate::Score> in_band = score_table(judged_table_, judged_, with, band());
      without_each_.clear();
      bool refused = false;
      for (std::size_t e = 0; e < engine_->accepted.size() && !refused; ++e) {
        const MatrixXd without = predicted_by(judged_table_, rebuilt_without(e)->robot());
        without_each_.push_back(rms_errors(judged_table_, without));
        const std::vector<validate::Score> in_band_without =
            score_table(judged_table_, judged_, without, band());
        const std::string why =
            harm(engine_->accepted[e], after, without_each_.back(), in_band, in_band_without);
        if (why.empty()) continue;
        if (!take_another_form(e, without_each_.back(), in_band_without)) take_out(e, why);
        refused = true;
      }
      if (refused) continue;
      const auto [paying, run, culprit] = who_pays(at_first, after, without_each_);
      if (culprit < 0) return;
      const auto at = static_cast<std::size_t>(culprit);
      if (hold_instead(at)) continue;
      take_out(at, fmt::format("raises the error of joint {} on {}", paying + 1, judged_table_.runs[run]));
    }
  }

  /// What an effect does to its own joint, and to all together, on the validation logs; empty: no harm.
  std::string harm(const Candidate& own, const std::vector<VectorXd>& after,
                   const std::vector<VectorXd>& before, const std::vector<validate::Score>& in_band,
                   const std::vector<validate::Score>& in_band_before) const {
    if (own.effect.is<Contact>()) return {};
    Index main = 0;
    fall(own.trial).maxCoeff(&main);
    std::string helps, hurts;
    double squares_after = 0.0, squares_before = 0.0;
    for (std::size_t r = 0; r < after.size(); ++r) {
      const VectorXd ratio = after[r].array() / before[r].array().max(1e-300);
      const double slow =
          in_band[r].rmse_in_band[main] / std::max(1e-300, in_band_before[r].rmse_in_band[main]) - 1.0;
      // All joints together: what an effect takes from one joint it may not put on the others.
      const bool bad = ratio[main] > 1.0 || slow > kMayRiseInBand || ratio.array().log().sum() > 0.0;
      (bad ? hurts : helps) = judged_table_.runs[r];
      squares_after += after[r][main] * after[r][main];
      squares_before += before[r][main] * before[r][main];
    }
    if (hurts.empty() && squares_after < squares_before) return {};
    return helps.empty() || hurts.empty() ? "raises the error on the validation logs"
                                          : fmt::format("helps on {} and hurts on {}", helps, hurts);
  }

  /// Against an effect of friction's memory that does harm: another of its forms that does none, the best first. One
  /// such exchange for each effect.
  /// @param before, in_band_before  errors without the effect, as in harm()
  bool take_another_form(std::size_t effect, const std::vector<VectorXd>& before,
                         const std::vector<validate::Score>& in_band_before) {
    const Candidate own = engine_->accepted[effect];
    if (!own.has_memory() || !exchanged_.insert(own.joint).second) return false;
    for (const Candidate& form : forms_of_memory(effect, {own.joint, -1})) {
      if (same_effect(form, own) && std::abs(std::log(form.shape / own.shape)) < 0.05) continue;
      auto tried = rebuilt_without(effect);
      tried->accepted.insert(tried->accepted.begin() + static_cast<std::ptrdiff_t>(effect), own);
      tried->put(effect, form);
      tried->build();
      const MatrixXd with = predicted_by(judged_table_, tried->robot());
      if (!harm(form, rms_errors(judged_table_, with), before,
                score_table(judged_table_, judged_, with, band()), in_band_before)
               .empty()) {
        continue;
      }
      engine_ = std::move(tried);
      evidence_.clear();
      trace(fmt::format("with {} of {:.3g} by {} for {:.3g} by {}", name_of(form), form.shape,
                        displacement_name(form.displacement), own.shape, displacement_name(own.displacement)),
            with);
      return true;
    }
    return false;
  }

  struct Paying {
    Index joint{-1};
    std::size_t run{0};
    int culprit{-1};  ///< effect that raises its error most; -1: none
  };
  /// A joint whose error on a validation log is above that of the fit without effects.
  static Paying who_pays(const std::vector<VectorXd>& at_first, const std::vector<VectorXd>& after,
                         const std::vector<std::vector<VectorXd>>& without_each) {
    Paying found;
    double most = kMayRise;
    for (std::size_t r = 0; r < after.size(); ++r) {
      Index joint = 0;
      const VectorXd rise = (after[r].array() / at_first[r].array().max(1e-300)).matrix();
      if (!(rise.maxCoeff(&joint) - 1.0 > most)) continue;
      most = rise[joint] - 1.0;
      found = {joint, r, -1};
      double worst = 1.0;
      for (std::size_t e = 0; e < without_each.size(); ++e) {
        const double ratio = after[r][joint] / std::max(1e-300, without_each[e][r][joint]);
        if (ratio > worst) worst = ratio, found.culprit = static_cast<int>(e);
      }
    }
    return found;
  }

  void take_out(std::size_t effect, const std::string& why) {
    const Candidate own = engine_->accepted[effect];
    refusals_.push_back({own.effect, own.joint, why, 1.0 - std::pow(1.0 - fall(own.trial).maxCoeff(), 2)});
    engine_->accepted.erase(engine_->accepted.begin() + static_cast<std::ptrdiff_t>(effect));
    engine_->build();
    evidence_.clear();
    trace("without " + name_of(own), predicted_by(judged_table_, engine_->robot()));
  }

  void findings(Diagnosis& result) {
    const model::Robot robot = engine_->robot();
    const MatrixXd with = predicted_by(judged_table_, robot);
    const VectorXd after = rms_error(judged_table_, with);
    for (std::size_t e = 0; e < engine_->accepted.size(); ++e) {
      const Candidate own = engine_->accepted[e];
      const VectorXd before = pooled(without_each_[e]);
      const std::vector<Candidate> candidates = evidence_.size() == engine_->accepted.size()
                                                    ? std::move(evidence_[e])
                                                    : propose(*rebuilt_without(e), own.joint, 0.95, 1.0);
      const int tried = std::max(tried_, tried_of(candidates));
      Finding f(own.effect);
      f.joint = own.joint;
      Trial trial = own.trial;
      for (const Candidate& c : candidates) {
        if (same_effect(c, own) && c.trial.valid) trial = c.trial;
      }
      Candidate judged = own;
      judged.trial = trial;
      f.p_value = std::min(1.0, trial.p_value * tried);
      f.delta_bic = bic_of(judged, tried);
      Index main = 0;
      f.cross_validated = fall(trial).maxCoeff(&main);
      if (own.effect.is<Contact>()) f.cross_validated = std::numeric_limits<double>::quiet_NaN();
      f.main_joint = static_cast<int>(main);
      f.validate_before = before[main];
      f.validate_after = after[main];
      for (const Candidate& c : candidates) {
        const bool same = same_place(c, own);
        // Another explanation is one of the same joint, or of the whole arm.
        const bool elsewhere = c.joint >= 0 && own.joint >= 0 && c.joint != own.joint;
        if (same || elsewhere || !c.trial.valid || !c.refused.empty() || c.effect.is<Contact>()) continue;
        // An effect comes in several forms, the best first; it is a rival once.
        const auto told = [&](const Rival& r) { return r.effect == c.effect && r.joint == c.joint; };
        if (std::any_of(f.rivals.begin(), f.rivals.end(), told) ||
            std::any_of(f.equivalent.begin(), f.equivalent.end(), told)) {
          continue;
        }
        if (c.trial.cv_gain > kEquivalent * trial.cv_gain) {
          f.equivalent.push_back({c.effect, c.joint, bic_of(c, tried)});
        } else if (c.trial.cv_gain > kRival * trial.cv_gain) {
          f.rivals.push_back({c.effect, c.joint, bic_of(c, tried)});
        }
      }
      describe(own, e, robot, f);
      result.findings.push_back(std::move(f));
    }
    std::stable_sort(result.findings.begin(), result.findings.end(),
                     [](const Finding& a, const Finding& b) { return a.delta_bic < b.delta_bic; });
  }

  /// Parameters of an accepted effect.
  void describe(const Candidate& own, std::size_t index, const model::Robot& robot, Finding& f) const {
    const VectorXd c = engine_->coefficients(index);
    own.effect.visit([&](auto type) {
      using Effect = decltype(type);
      if constexpr (ArmEffect<Effect>) {
        search_of(type).describe(own, c, robot, f);
      } else {
        const auto parameters =
            effect_parameters(joint_effect_kind<Effect>(), c, own.shape,
                              robot.joints[static_cast<std::size_t>(own.joint)].actuation);
        for (std::size_t k = 0; k < Effect::kParameters.size(); ++k) {
          f.parameters.emplace_back(std::string(Effect::kParameters[k].name), parameters[k]);
        }
        f.displacement = own.displacement;
      }
    });
  }

  static std::vector<Traces> traces(const MotionTable& table, const MatrixXd& before, const MatrixXd& after) {
    std::vector<Traces> all;
    for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
      const Index begin = table.run_begin[r], count = table.run_begin[r + 1] - begin;
      all.push_back({table.runs[r], table.time.segment(begin, count), table.q.middleRows(begin, count),
                     table.qd.middleRows(begin, count),
                     table.tau.middleRows(begin, count) - before.middleRows(begin, count),
                     table.tau.middleRows(begin, count) - after.middleRows(begin, count)});
    }
    return all;
  }

  void unexplained(Diagnosis& result) const {
    const MotionTable& table = engine_->table();
    const MatrixXd residual = engine_->problem().residual();
    const VectorXd noise = white_noise(table, residual);
    for (int j = 0; j < table.num_joints; ++j) {
      const double rows = engine_->problem().counted()[j];
      if (!(rows > 30.0) || leaves_unexplained(j)) continue;
      const double square = residual.col(j).squaredNorm() / rows;
      const double above = 1.0 - noise[j] * noise[j] / square;
      if (!options_.trace && above < kStructured) continue;
      const std::vector<Structure> found = structures(table, residual.col(j), j);
      if (options_.trace) {
        options_.trace(fmt::format("joint {}: {:.1f} % above noise; {} ({:.3f}); {} ({:.3f})", j + 1,
                                   100.0 * above, found[0].what, found[0].share, found[1].what,
                                   found[1].share));
      }
      if (above < kStructured) continue;
      Unexplained u;
      u.joint = j;
      u.what = fmt::format("{:.0f} % of the squared residual is no noise", 100.0 * above);
      if (found.front().share > 0.05) u.what += "; it " + found.front().what;
      u.evidence = {{"rms", std::sqrt(square)}, {"noise_rms", noise[j]}, {"share_above_noise", above}};
      for (std::size_t k = 0; k < std::min<std::size_t>(3, found.size()); ++k) {
        if (found[k].share < 0.05) break;
        u.evidence.emplace_back("share: " + found[k].what, found[k].share);
        if (found[k].frequency > 0.0) u.evidence.emplace_back("frequency_hz", found[k].frequency);
      }
      result.unexplained.push_back(std::move(u));
    }
  }

  model::Robot robot_;
  std::vector<GearCoupling<double>> pairs_;  ///< that may share a motor
  DiagnoseOptions options_;
  double cutoff_{0.0}, bandwidth_{0.0};  ///< [Hz]
  std::vector<data::MotionStream> train_, judged_;
  MotionTable train_table_, judged_table_;
  std::unique_ptr<Engine> engine_;
  std::vector<Refusal> refusals_;
  std::vector<std::vector<Candidate>> evidence_;     ///< candidates without each accepted effect
  std::vector<std::vector<VectorXd>> without_each_;  ///< [effect][validation log]: errors without it, n
  std::vector<std::string> notes_;
  std::vector<NotExplained> unexplained_joints_;  ///< see check_joints()
  std::set<int> exchanged_;  ///< joints whose memory has been given another form after a veto
  int tried_{0};
};

}  // namespace

Diagnosis diagnose(const model::Robot& robot, const std::vector<data::Log>& train,
                   const std::vector<data::Log>& validate, const DiagnoseOptions& options) {
  return Session(robot, train, validate, options).run();
}

}  // namespace heft::diagnose
