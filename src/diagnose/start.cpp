#include "start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "guards.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"
#include "heft/host/words.hpp"
#include "heft/model/without_effects.hpp"

namespace heft::diagnose {
namespace {

using Eigen::VectorXd;

/// Takes effects out of a robot.
/// @return which those were, in words
std::vector<std::string> strip(model::Robot& robot) {
  std::vector<std::string> taken_out;
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
  for (const JointCable<double>& cable : robot.cables)
    taken_out.push_back(fmt::format("cable over joints {} and {}", cable.driving + 1, cable.driven + 1));
  if (robot.torque_delay > 0.0) taken_out.push_back("delay of the torque channel");
  robot = model::without_effects(std::move(robot));
  return taken_out;
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

/// ln(error) of each joint, n: in their sum no joint counts more than another.
VectorXd logs_of(const VectorXd& rms) { return rms.cwiseMax(1e-12).array().log(); }

/// Chooses the low-pass of the motion.
class Cutoffs {
 public:
  Cutoffs(const std::vector<data::Log>& train, const DiagnoseOptions& options, double least, const Beside& beside,
          const model::Robot& identified, Start& start)
      : train_(train),
        options_(options),
        least_(least),
        beside_(beside),
        identified_(identified),
        start_(start),
        base_(std::make_shared<const BaseModel>(start.robot, searched_structure())) {}

  /// One for all joints.
  void choose() {
    double from_motion = 0.0, bandwidth = 0.0;
    for (const data::MotionStream& stream : streams_of(train_, {})) {
      if (highest_ == 0.0) highest_ = 0.4 * stream.summary().sample_rate;
      from_motion = std::max(from_motion, stream.summary().cutoff);
      bandwidth = std::max(bandwidth, stream.summary().bandwidth);
    }
    start_.band = options_.band > 0.0 ? options_.band : validate::default_band(bandwidth);
    start_.cutoff = options_.cutoff;
    if (start_.cutoff > 0.0) {
      host::for_each_parallel(beside_.size(), [&](std::size_t k) { beside_[k](start_); });
    } else {
      choose_for_all(from_motion);
    }
    start_.cutoffs.setConstant(start_.robot.num_joints(), start_.cutoff);
    start_.train_as_filed = std::make_shared<const JudgedMotion>(at(start_.cutoff));
    start_.train = start_.train_as_filed;
  }

  /// A higher one for joints that may have it, unless one was asked for.
  void raise() {
    if (!(options_.cutoff > 0.0) && start_.cutoff > 0.0) raise_for_each(*start_.train_as_filed);
  }

  /// Fits the rows behind them.
  void fit() {
    // What chose the cut-off has fitted these rows already, unless joints were raised.
    if (start_.engine == nullptr || &start_.engine->table() != &start_.train->table())
      start_.engine = std::make_unique<Engine>(base_, start_.train->shared_table(), start_.pairs);
  }

 private:
  /// The cut-off that leaves the smallest residual: a low one loses motion, a high one lets encoder noise in.
  void choose_for_all(double from_motion) {
    // Motion that is cut off cannot say what the torque does in the band that was asked for.
    const double asked = std::max(options_.band, least_), lowest = asked < highest_ ? asked : 0.0;
    std::vector<double> tried;
    for (double hz : {from_motion, 6.0, 12.0, 20.0, 32.0, 50.0}) {
      hz = std::max(hz, lowest);
      if (hz < highest_ && std::count(tried.begin(), tried.end(), hz) == 0) tried.push_back(hz);
    }
    std::vector<std::optional<JudgedMotion>> motions(tried.size());
    std::mutex guard;
    std::size_t best = tried.size();
    double least = 0.0;
    if (options_.progress) options_.progress("motion", 0.0);
    host::for_each_parallel(beside_.size() + tried.size(), [&](std::size_t job) {
      if (job < beside_.size()) {
        beside_[job](start_);
        return;
      }
      const std::size_t k = job - beside_.size();
      const double hz = tried[k] > 0.0 ? tried[k] : kNoMotion;
      motions[k].emplace(start_.robot, train_, Reading{hz});
      auto engine = std::make_unique<Engine>(base_, motions[k]->shared_table(), start_.pairs);
      double logs = logs_of(motions[k]->rms_error(engine->predicted())).sum();
      if (tried[k] == 0.0) logs = std::numeric_limits<double>::max();  // any other one says more
      const std::lock_guard<std::mutex> lock(guard);
      start_.residual_behind[hz] = logs;
      if (best < tried.size() && (logs > least || (logs == least && k > best))) return;
      best = k;
      least = logs;
      start_.engine = std::move(engine);
    });
    for (std::size_t k = 0; k < tried.size(); ++k)
      at_.try_emplace(tried[k] > 0.0 ? tried[k] : kNoMotion, std::move(*motions[k]));
    start_.cutoff = best < tried.size() ? tried[best] : 0.0;
    if (start_.cutoff == 0.0) start_.cutoff = from_motion;
  }

  /// Where the position of one joint may pass further up at no cost, it does: what is cut off leaves open when the joint
  /// turns back.
  void raise_for_each(const JudgedMotion& common) {
    JudgedMotion chosen = common;
    VectorXd least = logs_of(chosen.rms_error(chosen.predicted(identified_)));
    for (int j = start_.robot.num_joints() - 1; j >= 0; --j) {
      for (const auto& [hz, motion] : at_) {
        if (hz < kRaised * start_.cutoff) continue;
        chosen.take_joint_of(motion, j);
        const VectorXd logs = logs_of(chosen.rms_error(chosen.predicted(identified_)));
        // A joint that gains does not pay for another that loses: what one is rid of is no noise of the other.
        if ((logs - least).cwiseMax(0.0).sum() > kAsGood) {
          chosen.take_joint_of(at(start_.cutoffs[j]), j);
          break;
        }
        start_.cutoffs[j] = hz;
        least = least.cwiseMin(logs);
      }
    }
    if (options_.trace) {
      options_.trace(fmt::format("cut-off {:.3g} Hz, of the joints {:.3g} Hz", start_.cutoff,
                                 fmt::join(start_.cutoffs, " ")));
    }
    if (start_.one_cutoff()) return;
    start_.cutoff = start_.cutoffs.minCoeff();
    start_.train = std::make_shared<const JudgedMotion>(std::move(chosen));
    start_.train_as_filed = std::make_shared<const JudgedMotion>(at(start_.cutoff));
  }

  /// The training logs behind a cut-off.
  const JudgedMotion& at(double hz) {
    return at_.try_emplace(hz, start_.robot, train_, Reading{hz}).first->second;
  }

  /// Cut-off where the motion says nothing of it [Hz].
  static constexpr double kNoMotion = 5.0;
  /// A joint's cut-off is raised by at least this [1].
  static constexpr double kRaised = 1.3;
  /// Rise of ln(error), of all joints that rise together, that is none [1].
  static constexpr double kAsGood = 0.003;

  const std::vector<data::Log>& train_;
  const DiagnoseOptions& options_;
  double least_;
  const Beside& beside_;
  const model::Robot& identified_;
  Start& start_;
  std::shared_ptr<const BaseModel> base_;
  double highest_{0.0};  ///< cut-off that the sample rate allows [Hz]
  std::map<double, JudgedMotion> at_;
};

/// Largest speed of each joint in rows that count [rad/s, m/s].
VectorXd top_speeds(const MotionTable& table) {
  return (table.qd.cwiseAbs().array() * table.keep.array()).colwise().maxCoeff().transpose();
}

/// What the training logs cannot say of the validation logs. Empty: no joint is much faster there.
std::string note_on_speeds(const MotionTable& train, const MotionTable& judged) {
  constexpr double kFaster = 2.0;
  constexpr double kLeast = 1e-2;  // [rad/s, m/s]: a joint that hardly moves in one of them is another matter
  const VectorXd fitted = top_speeds(train), seen = top_speeds(judged);
  std::vector<int> joints;
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (int j = 0; j < train.num_joints; ++j) {
    if (fitted[j] < kLeast || seen[j] < kFaster * fitted[j]) continue;
    joints.push_back(j);
    least = std::min(least, seen[j] / fitted[j]);
    most = std::max(most, seen[j] / fitted[j]);
  }
  if (joints.empty()) return "";
  return fmt::format(
      "{} {} {} times as fast in the validation logs as in the training logs: what friction does at such speeds these do not show, "
      "and an effect that depends on speed may be refused for it; give a training log as fast, or exchange the two",
      host::joints_in_words(joints), joints.size() == 1 ? "moves" : "move",
      joints.size() == 1 ? fmt::format("{:.2g}", most) : fmt::format("{:.2g} to {:.2g}", least, most));
}

}  // namespace

Start start_of(const model::Robot& robot, const std::vector<data::Log>& train,
               const std::vector<data::Log>& validate, const DiagnoseOptions& options, const Beside& beside,
               const model::Robot& identified, double least_cutoff) {
  Start start;
  start.given = start.own = robot;
  start.pairs = pairs_of(robot, options);
  const std::vector<std::string> taken_out = strip(start.own);
  start.robot = start.own;
  for (model::RobotJoint& joint : start.robot.joints)
    joint.actuation.rotor_inertia = joint.actuation.friction_offset = 0.0;
  if (!taken_out.empty()) {
    start.notes.push_back(fmt::format(
        "the model's own {}: not kept but searched for again, since effects are found as what rigid "
        "bodies, Coulomb and viscous friction leave",
        fmt::join(taken_out, ", ")));
  }
  refuse_too_few_parameters(start.robot, train);
  Cutoffs cutoffs(train, options, least_cutoff, beside, identified, start);
  cutoffs.choose();
  const double common = start.cutoff;
  const auto read_judged = [&](double cutoff) {
    start.judged_as_filed = std::make_shared<const JudgedMotion>(start.robot, validate, Reading{cutoff});
  };
  const auto raise_judged = [&] {
    start.judged = std::make_shared<const JudgedMotion>(start.judged_as_filed->with_cutoffs(start.robot, validate, start.cutoffs));
  };
  host::for_each_parallel(2, [&](std::size_t k) { k == 0 ? cutoffs.raise() : read_judged(common); });
  if (start.cutoff != common) read_judged(start.cutoff);  // all joints were raised
  host::for_each_parallel(2, [&](std::size_t k) { k == 0 ? cutoffs.fit() : raise_judged(); });
  if (!(start.engine->problem().counted().maxCoeff() > 0.0)) {
    throw NotIdentifiableError(
        "no joint moves in the training logs; expected a motion in which every joint moves; record one, "
        "for instance from heft excite");
  }
  if (std::string note = note_on_speeds(start.train->table(), start.judged->table()); !note.empty())
    start.notes.push_back(std::move(note));
  return start;
}

}  // namespace heft::diagnose
