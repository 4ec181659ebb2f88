#include "heft/retime/retime.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "heft/data/motion_rows.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/sim/following.hpp"
#include "planner.hpp"

namespace heft::retime {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A limit of which this share is used decides how fast the motion is; tangents and lowered limits leave less.
constexpr double kActive = 0.995;
/// From the reference [rad, m]: what else is near the path may be hit; of a rigid arm with sharp friction a tenth is seen.
constexpr double kFarOff = 0.02;
/// Of the controller in the rehearsal [s].
constexpr double kSampleTime = 1e-3;
/// Plans beyond the first, each with the margins that the rehearsal before showed to be needed.
constexpr int kMostPlans = 8;

const model::RobotJoint& joint_of(const model::Robot& robot, Index j) {
  return robot.joints[static_cast<std::size_t>(j)];
}

/// One limit of every joint: what was asked for, else the robot's own.
VectorXd limit_of(const model::Robot& robot, const std::vector<double>& asked, const char* name,
                  double model::RobotJoint::*own) {
  const auto n = static_cast<std::size_t>(robot.num_joints());
  if (!asked.empty() && asked.size() != 1 && asked.size() != n) {
    throw ModelError(
        fmt::format("{} limits: found {} numbers; expected 1 for all joints or {} of robot \"{}\"", name,
                    asked.size(), n, robot.name));
  }
  VectorXd limit(robot.num_joints());
  for (std::size_t j = 0; j < n; ++j) {
    const double stated = own != nullptr ? robot.joints[j].*own : kInfinity;
    const double value = asked.empty() ? stated : asked.size() == 1 ? asked[0] : asked[j];
    if (!(value > 0.0)) {
      throw ModelError(fmt::format("{} limit of joint {} ({}): found {}; expected a number above 0; give one",
                                   name, j + 1, robot.joints[j].name, value));
    }
    limit[static_cast<Index>(j)] = value;
  }
  return limit;
}

void check_options(const Options& options) {
  const auto refuse = [](const char* name, double found, const char* expected) {
    throw ModelError(fmt::format("{}: found {}; expected {}", name, found, expected));
  };
  if (!(options.margin_percent >= 0.0 && options.margin_percent < 100.0))
    refuse("margin", options.margin_percent, "a part of the limits of at least 0 % and below 100 %");
  if (!(options.speed > 0.0 && options.speed <= 1.0))
    refuse("speed", options.speed, "a share of the velocity limits above 0, at most 1");
  if (!(options.rate > 0.0) || !std::isfinite(options.rate))
    refuse("rate", options.rate, "rows a second, above 0");
}

/// A joint that moves needs a limit of its acceleration, or of its torque.
void refuse_unlimited(const Retiming& found) {
  const VectorXd travel = found.path.points.colwise().maxCoeff() - found.path.points.colwise().minCoeff();
  for (Index j = 0; j < travel.size(); ++j) {
    if (!(travel[j] > 0.0) || std::isfinite(found.torque[j]) || std::isfinite(found.acceleration[j]))
      continue;
    throw ModelError(fmt::format(
        "robot \"{}\": joint {} ({}) has neither a torque nor an acceleration limit; expected one, without which there is no "
        "shortest time; give torque or acceleration limits, or an effort limit in the URDF",
        found.robot.name, j + 1, joint_of(found.robot, j).name));
  }
}

Profile profile_of(const Plan& plan, const VectorXd& places) {
  Profile profile;
  profile.s = places;
  profile.speed = plan.motion.x.cwiseSqrt();
  profile.fastest = plan.motion.highest.cwiseSqrt();
  profile.acceleration = plan.motion.u;
  profile.time = VectorXd::Zero(places.size());
  for (Index i = 0; i + 1 < places.size(); ++i) {
    profile.time[i + 1] =
        profile.time[i] + 2.0 * (places[i + 1] - places[i]) / (profile.speed[i] + profile.speed[i + 1]);
  }
  return profile;
}

std::vector<Stretch> stretches_of(const Plan& plan, const VectorXd& time) {
  std::vector<Stretch> stretches;
  for (std::size_t i = 0; i < plan.nearest.size(); ++i) {
    const Nearest& nearest = plan.nearest[i];
    if (nearest.use < kActive) continue;
    const auto at = static_cast<Index>(i);
    const bool goes_on = !stretches.empty() && stretches.back().end == time[at] &&
                         stretches.back().joint == nearest.joint && stretches.back().limit == nearest.limit;
    if (!goes_on) stretches.push_back({time[at], time[at], nearest.joint, nearest.limit});
    stretches.back().end = time[at + 1];
  }
  return stretches;
}

std::vector<Share> shares_of(const std::vector<Stretch>& stretches, double duration) {
  std::vector<Share> shares;
  for (const Stretch& stretch : stretches) {
    const auto same = std::find_if(shares.begin(), shares.end(), [&](const Share& share) {
      return share.joint == stretch.joint && share.limit == stretch.limit;
    });
    const double part = (stretch.end - stretch.begin) / duration;
    if (same == shares.end()) {
      shares.push_back({stretch.joint, stretch.limit, part});
    } else {
      same->share += part;
    }
  }
  std::sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) { return a.share > b.share; });
  return shares;
}

/// Position and its derivatives over time.
void motion_at(const Path& path, const Profile& profile, double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) {
  double s = 0.0, rate = 0.0, acceleration = 0.0;
  VectorXd dq, ddq;
  profile.evaluate(t, s, rate, acceleration);
  path.evaluate(s, q, dq, ddq);
  qd = dq * rate;
  qdd = dq * acceleration + ddq * rate * rate;
}

/// What a controller that samples and knows the motion ahead is given: the acceleration that brings the velocity to that of the
/// next sample.
class PathReference final : public sim::Reference {
 public:
  PathReference(const Retiming& found, double sample_time)
      : path_(found.path), profile_(found.profile), ahead_(sample_time) {}
  int num_joints() const override { return static_cast<int>(path_.points.cols()); }
  void evaluate(double t, Eigen::Ref<VectorXd> q, Eigen::Ref<VectorXd> qd,
                Eigen::Ref<VectorXd> qdd) const override {
    VectorXd a, v, d, next;
    motion_at(path_, profile_, t + ahead_, a, next, d);
    motion_at(path_, profile_, t, a, v, d);
    q = a, qd = v, qdd = (next - v) / ahead_;
  }

 private:
  Path path_;
  Profile profile_;
  double ahead_;
};

data::Log log_of(const Retiming& found, double rate) {
  // The last row is the first instant of the grid at which the arm is at rest.
  data::refuse_many_rows(found.duration(), rate);
  const auto rows = static_cast<Index>(std::ceil(found.duration() * rate - 1e-9)) + 1;
  const model::Dynamics dynamics(found.robot);
  data::Log log;
  log.time.resize(rows);
  log.q.resize(rows, found.robot.num_joints());
  log.qd = log.qdd = log.tau = log.q;
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    log.time[i] = static_cast<double>(i) / rate;
    motion_at(found.path, found.profile, log.time[i], q, qd, qdd);
    log.q.row(i) = q, log.qd.row(i) = qd, log.qdd.row(i) = qdd;
    log.tau.row(i) = dynamics.joint_torque(q, qd, qdd);
  }
  return log;
}

/// The first limit that simulated values exceed; empty: none.
std::string exceeded(const model::Robot& robot, const data::Log& log, const Eigen::MatrixXd& values,
                     const VectorXd& limit, const char* name) {
  for (Index j = 0; j < values.cols(); ++j) {
    Index row = 0;
    const double largest = values.col(j).cwiseAbs().maxCoeff(&row);
    if (largest <= limit[j]) continue;
    return fmt::format("{} of joint {} ({}) at {:.3f} s ({:.4g} of {:.4g})", name, j + 1,
                       joint_of(robot, j).name, log.time[row], largest, limit[j]);
  }
  return "";
}

Rehearsal rehearse(const Retiming& found) {
  Rehearsal result;
  // What stays of the motion behind its end shows in the last samples.
  constexpr double kAfter = 0.1;
  sim::SimulationSettings settings = sim::following(
      found.robot, std::make_shared<PathReference>(found, kSampleTime), found.duration() + kAfter);
  settings.sample_rate = 1.0 / kSampleTime;
  settings.log_rate = 0.0;  // every sample
  // The plan is judged, not an encoder: noise is what the margin is for.
  settings.sensors = {};
  try {
    result.log = sim::simulate(settings).log;
  } catch (const sim::SimulationError& error) {
    result.unable = error.what();
    return result;
  }
  result.torque = result.log.tau.cwiseAbs().colwise().maxCoeff();
  result.velocity = result.log.qd.cwiseAbs().colwise().maxCoeff();
  result.tracking_error = (result.log.q - result.log.qref).cwiseAbs().maxCoeff();
  result.failure = exceeded(found.robot, result.log, result.log.tau, found.torque, "torque");
  if (result.failure.empty())
    result.failure = exceeded(found.robot, result.log, result.log.qd, found.velocity, "velocity");
  return result;
}

/// Plans within the margins of `found`. @return by which share a limit is exceeded nevertheless
double plan_once(const model::Dynamics& dynamics, const Options& options, Retiming& found) {
  const double of_acceleration = 1.0 - 0.01 * options.margin_percent;
  const auto less = [](const VectorXd& limit, const VectorXd& margin) -> VectorXd {
    return limit.cwiseProduct(VectorXd::Ones(limit.size()) - margin);
  };
  const JointLimits limits{less(found.velocity, found.velocity_margin), of_acceleration * found.acceleration,
                           less(found.torque, found.torque_margin)};
  Planner planner(dynamics, found.path, limits);
  const Plan plan = planner.plan();
  found.profile = profile_of(plan, planner.places());
  found.active = stretches_of(plan, found.profile.time);
  found.velocity_use = less(plan.velocity_use, found.velocity_margin);
  found.acceleration_use = of_acceleration * plan.acceleration_use;
  found.torque_use = less(plan.torque_use, found.torque_margin);
  found.shares = shares_of(found.active, found.duration());
  found.lowered = plan.lowered;
  found.longer = found.duration() / plan.unlowered - 1.0;
  found.sweeps = plan.sweeps;
  found.log = log_of(found, options.rate);
  return plan.excess;
}

/// Raises the margins of joints that exceeded their limits by what they exceeded them.
void leave_more(const VectorXd& reached, const VectorXd& limit, VectorXd& margin) {
  constexpr double kAndALittle = 2e-4;
  for (Index j = 0; j < reached.size(); ++j) {
    if (reached[j] > limit[j]) margin[j] = 1.0 - (1.0 - margin[j]) * (limit[j] / reached[j] - kAndALittle);
  }
}

void judge(const Options& options, double excess, Retiming& found) {
  using host::Verdict;
  if (excess > 0.0) {
    found.judgement.add(
        Verdict::kBad,
        fmt::format("The plan exceeds a limit by {:.2g} %: the sweep did not converge", 100.0 * excess));
  }
  if (!found.rehearsal) {
    found.judgement.add(Verdict::kDoubtful, "The motion was not rehearsed on a simulated arm");
  } else if (!found.rehearsal->unable.empty()) {
    found.judgement.add(
        Verdict::kDoubtful,
        fmt::format(
            "The motion could not be simulated: {}; where links are physically impossible, heft identify "
            "--method physical fits a model that can be",
            found.rehearsal->unable));
  } else if (!found.rehearsal->failure.empty()) {
    found.judgement.add(
        Verdict::kBad,
        fmt::format("The simulated arm exceeds a limit: {}; a larger margin leaves the controller more",
                    found.rehearsal->failure));
  }
  if (found.rehearsal && found.rehearsal->tracking_error > kFarOff) {
    found.judgement.add(Verdict::kDoubtful,
                        fmt::format("The simulated arm is up to {:.2g} rad (m) off the reference",
                                    found.rehearsal->tracking_error));
  }
  if (options.behind_gears) {
    found.judgement.add(
        Verdict::kDoubtful,
        "The model was fitted to sensors behind the gears and lacks friction and rotors, which the "
        "motors have to move");
  }
  if (!found.robot.elasticities.empty()) {
    found.notes.emplace_back(
        "Elastic joints count as rigid in the plan; the simulated arm has their springs");
  }
}

}  // namespace

const char* to_string(Limit limit) {
  switch (limit) {
    case Limit::kTorque: return "torque";
    case Limit::kVelocity: return "velocity";
    case Limit::kAcceleration: return "acceleration";
  }
  return "limit";
}

void Profile::evaluate(double t, double& at, double& rate, double& linear) const {
  const auto next = std::upper_bound(time.begin(), time.end(), t);
  const Index i = std::clamp<Index>(next - time.begin() - 1, 0, acceleration.size() - 1);
  if (t >= duration()) {
    at = s[s.size() - 1], rate = 0.0, linear = 0.0;
    return;
  }
  const double since = std::max(t - time[i], 0.0);
  linear = acceleration[i];
  rate = std::max(speed[i] + linear * since, 0.0);
  at = std::min(s[i] + since * (speed[i] + 0.5 * linear * since), s[i + 1]);
}

Retiming retime(const model::Robot& robot, const Path& path, const Options& options) {
  check_options(options);
  Retiming found;
  found.robot = model::with_load(robot, options.load);
  found.path = path;
  found.velocity =
      options.speed * limit_of(robot, options.velocity, "velocity", &model::RobotJoint::velocity_limit);
  found.acceleration = limit_of(robot, options.acceleration, "acceleration", nullptr);
  found.torque = limit_of(robot, options.torque, "torque", &model::RobotJoint::effort_limit);
  found.notes = path.notes;
  refuse_unlimited(found);

  const model::Dynamics dynamics(found.robot);
  const int n = found.robot.num_joints();
  found.velocity_margin = found.torque_margin = VectorXd::Constant(n, 0.01 * options.margin_percent);
  double excess = plan_once(dynamics, options, found);
  for (int again = 0; options.rehearse; ++again) {
    found.rehearsal = rehearse(found);
    const bool enough = found.rehearsal->passed() || !found.rehearsal->unable.empty() || again == kMostPlans;
    if (enough) break;
    leave_more(found.rehearsal->velocity, found.velocity, found.velocity_margin);
    leave_more(found.rehearsal->torque, found.torque, found.torque_margin);
    excess = plan_once(dynamics, options, found);
  }
  judge(options, excess, found);
  return found;
}

}  // namespace heft::retime
