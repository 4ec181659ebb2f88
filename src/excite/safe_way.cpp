/// A safe way between two poses.
#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

#include "heft/excite/motion.hpp"
#include "heft/host/error.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kMostNodes = 6000;  // of both trees together
constexpr int kShortcuts = 200;   // tried on a way through waypoints
constexpr double kStep = 0.4;     // of a tree [rad, or m over the arm's length]
constexpr int kSlowDowns = 60;    // tried for the duration of a line
constexpr double kSlowDown = 1.15;

/// Straight lines in joint space that keep clear, and trees of them.
class Planner {
 public:
  explicit Planner(const LimitCheck& check) : check_(check), reach_(VectorXd::Ones(check.n())) {
    // A joint's turn moves no point further than its distance from the tip, at most.
    double reach = vector_of(check.robot.tip_position).norm() + check.limits.tool.norm();
    for (Index j = check.n() - 1; j >= 0; --j) {
      const model::RobotJoint& joint = joint_of(check.robot, j);
      if (joint.joint.type == JointType::kRevolute) reach_[j] = std::max(reach, 1e-3);
      reach += vector_of(joint.joint.position).norm();
    }
    // Between checks nothing comes nearer by more than half the clearance.
    spacing_ = std::max(0.25 * check.limits.clearance, 1e-3 * reach);
  }

  bool clear(const VectorXd& from, const VectorXd& to, std::string* what = nullptr) const {
    const double moved = (to - from).cwiseAbs().dot(reach_);
    const int steps = std::max(1, static_cast<int>(std::ceil(moved / spacing_)));
    for (int k = 0; k <= steps; ++k) {
      if (!(check_.pose_slack(from + (to - from) * k / steps, what) > 0.0)) return false;
    }
    return true;
  }

  /// Waypoints, ends included; empty when none are found.
  std::vector<VectorXd> through_waypoints(const VectorXd& from, const VectorXd& to) const {
    std::mt19937_64 random(1);
    std::array<Tree, 2> trees{Tree{{from}, {0}}, Tree{{to}, {0}}};
    for (std::size_t grown = 0; trees[0].poses.size() + trees[1].poses.size() < kMostNodes;
         grown = 1 - grown) {
      Tree &tree = trees[grown], &other = trees[1 - grown];
      if (!extend(tree, random_position(random, check_.middle, check_.half, 1.0)) &&
          ++failures_ > 20 * kMostNodes)
        break;
      // The other tree grows towards the new pose as long as it can.
      const VectorXd target = tree.poses.back();
      while (extend(other, target)) {
        if ((other.poses.back() - target).norm() > 1e-9) continue;
        std::vector<VectorXd> way =
            back_to_root(trees[0], grown == 0 ? tree.poses.size() - 1 : trees[0].poses.size() - 1);
        std::reverse(way.begin(), way.end());
        const std::vector<VectorXd> rest = back_to_root(trees[1], trees[1].poses.size() - 1);
        way.insert(way.end(), rest.begin() + 1, rest.end());
        return shortened(way, random);
      }
    }
    return {};
  }

 private:
  struct Tree {
    std::vector<VectorXd> poses;
    std::vector<std::size_t> parent;
  };

  bool extend(Tree& tree, const VectorXd& target) const {
    std::size_t nearest = 0;
    for (std::size_t k = 1; k < tree.poses.size(); ++k) {
      if ((tree.poses[k] - target).squaredNorm() < (tree.poses[nearest] - target).squaredNorm()) nearest = k;
    }
    const VectorXd way = target - tree.poses[nearest];
    if (way.norm() < 1e-12) return false;
    const VectorXd next =
        way.norm() <= kStep ? target : VectorXd(tree.poses[nearest] + way * (kStep / way.norm()));
    if (!clear(tree.poses[nearest], next)) return false;
    tree.poses.push_back(next);
    tree.parent.push_back(nearest);
    return true;
  }

  static std::vector<VectorXd> back_to_root(const Tree& tree, std::size_t at) {
    std::vector<VectorXd> way{tree.poses[at]};
    while (at != 0) way.push_back(tree.poses[at = tree.parent[at]]);
    return way;
  }

  std::vector<VectorXd> shortened(std::vector<VectorXd> way, std::mt19937_64& random) const {
    for (int k = 0; k < kShortcuts && way.size() > 2; ++k) {
      std::uniform_int_distribution<std::size_t> pick(0, way.size() - 1);
      std::size_t a = pick(random), b = pick(random);
      if (a > b) std::swap(a, b);
      if (b - a < 2 || !clear(way[a], way[b])) continue;
      way.erase(way.begin() + static_cast<std::ptrdiff_t>(a) + 1,
                way.begin() + static_cast<std::ptrdiff_t>(b));
    }
    return way;
  }

  const LimitCheck& check_;
  VectorXd reach_;
  double spacing_;
  mutable int failures_{0};
};

/// The line in the shortest time in which it keeps all limits.
Piece timed_line(const LimitCheck& check, const std::string& name, const VectorXd& from, const VectorXd& to) {
  constexpr Index kSamples = 200;
  // Largest slope and curvature of the fifth-order step: 15/8 and 10/√3.
  double duration = 0.5;
  for (Index j = 0; j < from.size(); ++j) {
    const double way = std::abs(to[j] - from[j]);
    duration = std::max(
        {duration, 1.875 * way / check.velocity[j], std::sqrt(5.7735027 * way / check.acceleration[j])});
  }
  Closest found;
  Samples samples{Eigen::MatrixXd(kSamples, from.size()), {}, {}};
  samples.qd = samples.qdd = samples.q;
  VectorXd q, qd, qdd;
  for (int attempt = 0; attempt < kSlowDowns; ++attempt, duration *= kSlowDown) {
    const Piece piece = line_piece(name, from, to, duration);
    for (Index i = 0; i < kSamples; ++i) {
      piece.at(duration * static_cast<double>(i) / (kSamples - 1), q, qd, qdd);
      samples.q.row(i) = q;
      samples.qd.row(i) = qd;
      samples.qdd.row(i) = qdd;
    }
    found = check.closest(samples, 0.0);
    if (found.slack > 0.0) return piece;
  }
  throw NotIdentifiableError(
      fmt::format("robot \"{}\": {}: no safe motion on the way, however slow; the limit that stops it: {}; "
                  "widen it or take another pose",
                  check.robot.name, name, found.what));
}

void refuse_pose(const LimitCheck& check, const std::string& name, const char* which, const VectorXd& q) {
  std::string what;
  if (check.pose_slack(q, &what) > 0.0) return;
  throw NotIdentifiableError(
      fmt::format("robot \"{}\": {}: its {} cannot be held with the margins kept: {}; take another pose (in "
                  "rad, m) or widen that limit",
                  check.robot.name, name, which, what));
}

}  // namespace

std::vector<Piece> safe_way(const model::Robot& robot, const MotionLimits& limits, const std::string& name,
                            const VectorXd& from, const VectorXd& to) {
  const LimitCheck check(robot, limits);
  for (const VectorXd* pose : {&from, &to}) {
    if (pose->size() != robot.num_joints() || !pose->allFinite()) {
      throw ModelError(fmt::format("robot \"{}\": {}: found a pose of {} numbers, expected {} finite ones",
                                   robot.name, name, pose->size(), robot.num_joints()));
    }
  }
  refuse_pose(check, name, "first pose", from);
  refuse_pose(check, name, "last pose", to);
  std::vector<Piece> pieces;
  if ((to - from).norm() < 1e-9) return pieces;
  const Planner planner(check);
  std::vector<VectorXd> way{from, to};
  std::string stopped;
  if (!planner.clear(from, to, &stopped)) way = planner.through_waypoints(from, to);
  if (way.empty()) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": {}: no safe way was found between the poses; the straight one is stopped "
                    "by: {}; take another pose or widen that limit",
                    robot.name, name, stopped));
  }
  for (std::size_t k = 0; k + 1 < way.size(); ++k)
    pieces.push_back(timed_line(check, name, way[k], way[k + 1]));
  return pieces;
}

}  // namespace heft::excite
