#include "start.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "guards.hpp"
#include "heft/host/error.hpp"
#include "heft/model/without_effects.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
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

/// Training logs at one cut-off and the fit to them.
void fit_at(double cutoff, const std::shared_ptr<const BaseModel>& base, const std::vector<data::Log>& train,
            Start& start) {
  start.train = std::make_unique<JudgedMotion>(start.robot, train, Reading{cutoff});
  start.engine = std::make_unique<Engine>(base, start.train->shared_table(), start.pairs);
}

/// The cut-off that leaves the smallest residual: a low one loses motion, a high one lets encoder noise in.
void choose_cutoff(const std::vector<data::Log>& train, const DiagnoseOptions& options, Start& start) {
  double from_motion = 0.0, highest = 0.0, bandwidth = 0.0;
  for (const data::MotionStream& stream : streams_of(train, {})) {
    if (highest == 0.0) highest = 0.4 * stream.summary().sample_rate;
    from_motion = std::max(from_motion, stream.summary().cutoff);
    bandwidth = std::max(bandwidth, stream.summary().bandwidth);
  }
  start.band = options.band > 0.0 ? options.band : validate::default_band(bandwidth);
  start.cutoff = options.cutoff;
  const auto base = std::make_shared<const BaseModel>(start.robot, searched_structure());
  if (start.cutoff > 0.0) return fit_at(start.cutoff, base, train, start);
  // Motion that is cut off cannot say what the torque does in the band that was asked for.
  const double lowest = options.band < highest ? options.band : 0.0;
  double least = 0.0, tried = -1.0;
  int step = 0;
  Start at;
  at.robot = start.robot;
  at.pairs = start.pairs;
  for (double hz : {from_motion, 6.0, 12.0, 20.0, 32.0}) {
    if (options.progress) options.progress("motion", 0.05 * step++ / 5.0);  // the effects take the rest
    hz = std::max(hz, lowest);
    if (hz == tried || hz >= highest) continue;
    tried = hz;
    fit_at(hz > 0.0 ? hz : 5.0, base, train, at);
    double logs = 0.0;
    const VectorXd rms = at.train->rms_error(at.engine->predicted());
    for (Index j = 0; j < rms.size(); ++j) logs += std::log(std::max(1e-12, rms[j]));
    if (start.cutoff == 0.0 || logs < least) {
      least = logs;
      start.cutoff = hz;
      start.engine = std::move(at.engine);
      start.train = std::move(at.train);
    }
  }
  if (start.cutoff > 0.0) return;
  start.cutoff = from_motion;
  fit_at(start.cutoff, base, train, start);
}

}  // namespace

Start start_of(const model::Robot& robot, const std::vector<data::Log>& train,
               const std::vector<data::Log>& validate, const DiagnoseOptions& options) {
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
  choose_cutoff(train, options, start);
  start.judged = std::make_unique<JudgedMotion>(start.robot, validate, Reading{start.cutoff});
  if (!(start.engine->problem().counted().maxCoeff() > 0.0)) {
    throw NotIdentifiableError(
        "no joint moves in the training logs; expected a motion in which every joint moves; record one, "
        "for instance from heft excite");
  }
  return start;
}

}  // namespace heft::diagnose
