/// Strokes at constant speed, joint by joint.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <fmt/format.h>

#include "finish_motion.hpp"
#include "heft/host/error.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kPosesTried = 200;
constexpr double kScanStep = 0.02;       // of a joint's range
constexpr double kShortestRamp = 0.6;    // from rest to constant speed [s]
constexpr double kShortestStroke = 0.4;  // at constant speed [s]
constexpr double kSlower = 0.85;
constexpr int kSlowerStrokes = 40;

/// How far a joint may go with the others at rest.
struct FreeRange {
  double low{0.0}, high{0.0};
  double width() const { return high - low; }
};

FreeRange free_range(const LimitCheck& check, const VectorXd& pose, Index joint) {
  const double step = kScanStep * check.half[joint];
  const auto furthest = [&](double direction) {
    VectorXd q = pose;
    double reached = pose[joint];
    while (true) {
      q[joint] += direction * step;
      if (!(check.pose_slack(q) > 0.0) || !(check.closest_at_rest(q).slack > 0.0)) return reached;
      reached = q[joint];
    }
  };
  return {furthest(-1.0), furthest(1.0)};
}

/// The pose of those tried around which the joints have most room, every joint as a share of its range.
VectorXd roomiest_pose(const LimitCheck& check, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  VectorXd best;
  double most = -std::numeric_limits<double>::infinity();
  std::string missed;
  for (int k = 0; k < kPosesTried; ++k) {
    const VectorXd q = random_position(random, check.middle, check.half, 0.7);
    const Closest found = check.closest_at_rest(q);
    if (!(found.slack > 0.02)) {
      missed = found.what;
      continue;
    }
    double room = 0.0;
    for (Index j = 0; j < q.size(); ++j)
      room += std::log(1e-3 + free_range(check, q, j).width() / check.half[j]);
    if (room > most) {
      most = room;
      best = q;
    }
  }
  if (best.size() == 0) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": limits: no pose found in {} tries at which the arm is inside all of "
                    "them, so there is no safe motion; last missed: {}; widen that limit",
                    check.robot.name, kPosesTried, missed));
  }
  return best;
}

/// Up to speed, constant, and to rest again; velocity follows the fifth-order step in the ramps.
struct Profile {
  double speed{0.0}, ramp{0.0}, constant{0.0};  ///< [rad/s; s; s]
  double duration() const { return 2.0 * ramp + constant; }
  double length() const { return speed * (ramp + constant); }
  void at(double t, double& s, double& v, double& a) const {
    const bool stopping = t > ramp + constant;
    const double x = std::clamp((stopping ? duration() - t : t) / ramp, 0.0, 1.0);
    // Integral, value and slope of 10x³ − 15x⁴ + 6x⁵.
    const double way = speed * ramp * x * x * x * x * (2.5 + x * (x - 3.0));
    v = speed * x * x * x * (10.0 + x * (6.0 * x - 15.0));
    a = speed / ramp * 30.0 * x * x * (1.0 - x) * (1.0 - x) * (stopping ? -1.0 : 1.0);
    s = stopping ? length() - way : t <= ramp ? way : 0.5 * speed * ramp + speed * (t - ramp);
  }
};

Piece stroke_piece(const VectorXd& pose, Index joint, double from, double direction, const Profile& profile) {
  return {fmt::format("joint {}", joint + 1), profile.duration(),
          [=](double t, VectorXd& q, VectorXd& qd, VectorXd& qdd) {
            double s = 0.0, v = 0.0, a = 0.0;
            profile.at(t, s, v, a);
            q = pose;
            qd = qdd = VectorXd::Zero(pose.size());
            q[joint] = from + direction * s;
            qd[joint] = direction * v;
            qdd[joint] = direction * a;
          }};
}

Closest closest_of(const LimitCheck& check, const Piece& piece) {
  const auto rows = static_cast<Index>(std::clamp(piece.duration * 200.0, 50.0, 4000.0));
  Samples samples{Eigen::MatrixXd(rows, check.n()), {}, {}};
  samples.qd = samples.qdd = samples.q;
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    piece.at(piece.duration * static_cast<double>(i) / static_cast<double>(rows - 1), q, qd, qdd);
    samples.q.row(i) = q;
    samples.qd.row(i) = qd;
    samples.qdd.row(i) = qdd;
  }
  return check.closest(samples, 0.0);
}

/// A stroke about the middle of the range at this speed or the next lower one that keeps the limits.
Profile safe_profile(const LimitCheck& check, const VectorXd& pose, Index joint, const FreeRange& range,
                     double speed, double longest) {
  Closest found;
  const double room = 0.98 * range.width(), middle = 0.5 * (range.low + range.high);
  for (int attempt = 0; attempt < kSlowerStrokes; ++attempt, speed *= kSlower) {
    Profile profile;
    profile.speed = speed;
    profile.ramp = std::max(kShortestRamp, 1.875 * speed / (0.95 * check.acceleration[joint]));
    profile.constant = std::min(longest, room / speed - profile.ramp);
    if (profile.constant < std::min(kShortestStroke, longest)) continue;
    found = closest_of(check, stroke_piece(pose, joint, middle - 0.5 * profile.length(), 1.0, profile));
    if (!(found.slack > 0.0)) continue;
    found = closest_of(check, stroke_piece(pose, joint, middle + 0.5 * profile.length(), -1.0, profile));
    if (found.slack > 0.0) return profile;
  }
  throw NotIdentifiableError(fmt::format(
      "robot \"{}\": {}: no safe stroke, however slow; the limit that stops it: {}; take another pose "
      "(--start) or widen that limit",
      check.robot.name, joint_name(check.robot, joint),
      found.what.empty() ? fmt::format("room of {:.3g} rad or m only", range.width()) : found.what));
}

void check_options(const model::Robot& robot, const FrictionOptions& options) {
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  if (options.speeds < 1 || options.speeds > 50)
    refuse(fmt::format("speeds: found {}, expected 1 to 50", options.speeds));
  if (!(options.slowest > 0.0 && options.slowest <= 1.0)) {
    refuse(
        fmt::format("slowest speed: found {} of the fastest, expected above 0, at most 1", options.slowest));
  }
  if (!(options.longest_stroke > 0.0 && options.longest_stroke <= 600.0)) {
    refuse(fmt::format("stroke: found {} s, expected above 0, at most 600", options.longest_stroke));
  }
  if (options.pose.size() > 0 && options.pose.size() != robot.num_joints()) {
    refuse(fmt::format("start: found {} numbers, expected {}, one a joint", options.pose.size(),
                       robot.num_joints()));
  }
  for (const int joint : options.joints) {
    if (joint < 0 || joint >= robot.num_joints()) {
      refuse(fmt::format("joints: found {}, expected 1 to {}", joint + 1, robot.num_joints()));
    }
  }
}

/// All strokes of one joint, from the pose and back to it.
void add_joint(const LimitCheck& check, const FrictionOptions& options, Index joint, FrictionMotion& motion,
               std::vector<Piece>& pieces, double& time) {
  const VectorXd& pose = motion.pose;
  const FreeRange range = free_range(check, pose, joint);
  const Profile fastest =
      safe_profile(check, pose, joint, range, check.velocity[joint], options.longest_stroke);
  const auto put = [&](const Piece& piece) {
    pieces.push_back(piece);
    time += piece.duration;
  };
  VectorXd at = pose;
  const auto go_to = [&](double position) {
    VectorXd next = pose;
    next[joint] = position;
    if (std::abs(position - at[joint]) < 1e-9) return;
    for (const Piece& piece : safe_way(motion.robot, motion.limits,
                                       fmt::format("way to the strokes of joint {}", joint + 1), at, next))
      put(piece);
    at = next;
  };
  for (int k = 0; k < options.speeds; ++k) {
    const double exponent = options.speeds > 1 ? static_cast<double>(k) / (options.speeds - 1) : 1.0;
    const double speed = fastest.speed * std::pow(options.slowest, 1.0 - exponent);
    const Profile profile = safe_profile(check, pose, joint, range, speed, options.longest_stroke);
    const double middle = 0.5 * (range.low + range.high);
    double from = middle - 0.5 * profile.length();
    go_to(from);
    for (const double direction : {1.0, -1.0}) {
      const double ramped = 0.5 * profile.speed * profile.ramp;
      motion.strokes.push_back({static_cast<int>(joint), direction * profile.speed, time + profile.ramp,
                                time + profile.ramp + profile.constant, from + direction * ramped,
                                from + direction * (ramped + profile.speed * profile.constant)});
      put(stroke_piece(pose, joint, from, direction, profile));
      from += direction * profile.length();
    }
  }
  go_to(pose[joint]);
}

}  // namespace

FrictionMotion friction_strokes(const model::Robot& robot, const MotionLimits& limits,
                                const FrictionOptions& options) {
  check_options(robot, options);
  FrictionMotion motion;
  motion.robot = model::with_load(robot, options.payload);
  const LimitCheck check(motion.robot, limits);
  motion.limits = check.limits;
  motion.pose = options.pose.size() > 0 ? options.pose : roomiest_pose(check, options.seed);
  const Closest at_rest = check.closest_at_rest(motion.pose);
  if (!(at_rest.slack > 0.0)) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": start: at this pose the arm passes a limit ({}); expected a pose inside "
                    "all limits with their margin",
                    robot.name, at_rest.what));
  }
  std::vector<int> joints = options.joints;
  if (joints.empty()) {
    for (int j = 0; j < robot.num_joints(); ++j) joints.push_back(j);
  }
  std::vector<Piece> pieces;
  double time = 0.0;
  for (const int joint : joints) add_joint(check, options, joint, motion, pieces, time);
  finish_motion(motion, pieces, options.from, options.rate, options.rehearse);
  for (const Phase& phase : motion.phases) {
    if (phase.name != "motion") continue;
    for (Stroke& stroke : motion.strokes) {
      stroke.begin += phase.begin;
      stroke.end += phase.begin;
    }
  }
  return motion;
}

}  // namespace heft::excite
