#include "limit_check.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using collision::Capsule;
using collision::LinkFrames;
using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Distances count as shares of a clearance that is at least this [m].
constexpr double kLeastClearance = 1e-3;
constexpr const char* kTool = "the tool";  // name of the capsule that is added for it

model::Robot without_coulomb(model::Robot robot) {
  for (model::RobotJoint& joint : robot.joints) joint.actuation.coulomb_friction = 0.0;
  for (GearCoupling<double>& coupling : robot.couplings) coupling.coulomb_friction = 0.0;
  return robot;
}

std::string words(const collision::ArmCapsules& arm, const collision::CapsulePair& pair) {
  return fmt::format("distance of {} from {}", arm.capsules[static_cast<std::size_t>(pair.first)].name,
                     arm.capsules[static_cast<std::size_t>(pair.second)].name);
}

}  // namespace

VectorXd random_position(std::mt19937_64& random, const VectorXd& middle, const VectorXd& half,
                         double share) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  VectorXd q(middle.size());
  for (Index j = 0; j < q.size(); ++j) q[j] = middle[j] + share * half[j] * unit(random);
  return q;
}

LimitCheck::LimitCheck(const model::Robot& given, const MotionLimits& given_limits, double share)
    : robot(given), limits(given_limits), dynamics_(given), smooth_(without_coulomb(given)) {
  check_limits(robot, limits);
  const double use = 1.0 - limits.margin;
  middle = 0.5 * (limits.lower + limits.upper);
  half = 0.5 * use * (limits.upper - limits.lower);
  velocity = use * limits.velocity;
  acceleration = use * limits.acceleration;
  torque = use * limits.torque;
  tool_speed = use * limits.tool_speed;
  coulomb.resize(n());
  for (int j = 0; j < n(); ++j) coulomb[j] = joint_of(robot, j).actuation.coulomb_friction;
  for (const GearCoupling<double>& coupling : robot.couplings) {
    coulomb[coupling.driven] += coupling.coulomb_friction;
    coulomb[coupling.driving] += std::abs(coupling.ratio) * coupling.coulomb_friction;
  }
  const Vector3d gravity = vector_of(robot.gravity);
  if (gravity.norm() > 0.0) up_ = -gravity.normalized();
  if (limits.floor && gravity.norm() == 0.0) {
    throw ModelError(
        fmt::format("robot \"{}\": floor: found {} m without gravity, which says what is up; leave "
                    "the floor out or use a box",
                    robot.name, *limits.floor));
  }
  const Vector3d tip = vector_of(robot.tip_position);
  const bool has_tool = !limits.arm.capsules.empty() && limits.arm.capsules.back().name == kTool;
  if (limits.tool.norm() > 0.0 && !limits.arm.capsules.empty() && !has_tool) {
    Capsule tool;
    tool.link = n() - 1;
    tool.a = tip;
    tool.b = tip + matrix_of(robot.tip_rotation) * limits.tool;
    tool.radius = limits.tool_radius;
    tool.name = kTool;
    limits.arm.capsules.push_back(tool);
  }
  if (!limits.arm.capsules.empty()) {
    collision::choose_pairs(robot, limits.lower, limits.upper, limits.clearance, limits.obstacles,
                            limits.arm);
  }
  limits.clearance *= share;
  for (collision::CapsulePair& pair : limits.arm.pairs) pair.clearance *= share;
  place_walls();
  place_points();
  keep_what_varies();
  has_space = !walls.empty() || !points.empty() || !limits.arm.pairs.empty() || !limits.arm.guarded.empty();
}

void LimitCheck::add_walls(int link, const Vector3d& point, double radius, const std::string& name) {
  const double apart = limits.clearance + radius;
  if (limits.floor)
    walls.push_back({link, point, up_, *limits.floor + apart, "height of " + name, true, radius});
  if (!limits.box) return;
  for (Index a = 0; a < 3; ++a) {
    const double low = (*limits.box)[0][a], high = (*limits.box)[1][a];
    const std::string text = fmt::format("{} of {} in the box", "xyz"[a], name);
    if (std::isfinite(low))
      walls.push_back({link, point, Vector3d::Unit(a), low + apart, text, false, radius});
    if (std::isfinite(high))
      walls.push_back({link, point, -Vector3d::Unit(a), apart - high, text, false, radius});
  }
}

void LimitCheck::place_walls() {
  for (const Capsule& capsule : limits.arm.capsules) {
    if (capsule.link < 0) continue;
    add_walls(capsule.link, capsule.a, capsule.radius, capsule.name);
    if (capsule.a != capsule.b) add_walls(capsule.link, capsule.b, capsule.radius, capsule.name);
  }
  if (limits.arm.capsules.empty()) {
    for (int j = 0; j < n(); ++j) add_walls(j, Vector3d::Zero(), 0.0, joint_of(robot, j).link_name);
  }
  const Vector3d tool = vector_of(robot.tip_position) + matrix_of(robot.tip_rotation) * limits.tool;
  if (tool.norm() > 0.0)
    add_walls(n() - 1, tool, 0.0, limits.tool.norm() > 0.0 ? "the tool" : robot.tip_link);
}

void LimitCheck::place_points() {
  if (!std::isfinite(limits.tool_speed)) return;
  for (int j = 1; j < n(); ++j)
    points.push_back({j, Vector3d::Zero(), "speed of " + joint_of(robot, j).link_name});
  const Vector3d tip = vector_of(robot.tip_position);
  points.push_back({n() - 1, tip, "speed of " + robot.tip_link});
  if (limits.tool.norm() > 0.0) {
    points.push_back({n() - 1, tip + matrix_of(robot.tip_rotation) * limits.tool, "speed of the tool"});
  }
}

void LimitCheck::keep_what_varies() {
  std::mt19937_64 random(1);
  std::vector<double> low(walls.size(), kInfinity), high(walls.size(), -kInfinity);
  std::vector<double> fastest(points.size(), 0.0);
  for (int s = 0; s < 20; ++s) {
    const LinkFrames frames(robot, random_position(random, middle, half, 1.0));
    for (std::size_t w = 0; w < walls.size(); ++w) {
      low[w] = std::min(low[w], walls[w].slack(frames));
      high[w] = std::max(high[w], walls[w].slack(frames));
    }
    const VectorXd qd = random_position(random, VectorXd::Zero(n()), VectorXd::Ones(n()), 1.0);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Vector3d P = frames.at(points[k].link, points[k].point);
      fastest[k] = std::max(fastest[k], frames.velocity(points[k].link, P, qd).norm());
    }
  }
  std::vector<Wall> kept;
  for (std::size_t w = 0; w < walls.size(); ++w) {
    if (high[w] - low[w] > 1e-9) kept.push_back(walls[w]);
  }
  walls = std::move(kept);
  std::vector<SpeedPoint> moving;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (fastest[k] > 1e-9) moving.push_back(points[k]);
  }
  points = std::move(moving);
}

VectorXd LimitCheck::torque_without_coulomb(const VectorXd& q, const VectorXd& qd,
                                            const VectorXd& qdd) const {
  return smooth_.joint_torque(q, qd, qdd);
}

double LimitCheck::pose_slack(const VectorXd& q, std::string* what) const {
  return pose_slack(LinkFrames(robot, q), q, what);
}

double LimitCheck::pose_slack(const LinkFrames& frames, const VectorXd& q, std::string* what) const {
  double least = kInfinity;
  const auto meet = [&](double slack, const auto& name) {
    if (!(slack < least)) return;
    least = slack;
    if (what != nullptr) *what = name();
  };
  for (int j = 0; j < n(); ++j) {
    meet(1.0 - std::abs(q[j] - middle[j]) / half[j], [&] { return "position of " + joint_name(robot, j); });
  }
  const auto share = [](double spare, double clearance) {
    return spare / std::max(clearance, kLeastClearance);
  };
  for (const Wall& wall : walls) {
    meet(share(wall.slack(frames), limits.clearance), [&] { return wall.name; });
  }
  const auto& capsules = limits.arm.capsules;
  for (const collision::CapsulePair& pair : limits.arm.pairs) {
    const auto found = collision::distance(frames, capsules[static_cast<std::size_t>(pair.first)],
                                           capsules[static_cast<std::size_t>(pair.second)]);
    meet(share(found.distance - pair.clearance, pair.clearance), [&] { return words(limits.arm, pair); });
  }
  for (const collision::GuardedObstacle& guarded : limits.arm.guarded) {
    const Capsule& capsule = capsules[static_cast<std::size_t>(guarded.capsule)];
    const auto& box = limits.obstacles[static_cast<std::size_t>(guarded.obstacle)];
    meet(share(collision::distance(frames, capsule, box).distance - limits.clearance, limits.clearance),
         [&] { return fmt::format("distance of {} from {}", capsule.name, box.name); });
  }
  return least;
}

Closest LimitCheck::closest(const Samples& motion, double enough) const {
  Closest result{kInfinity, "", 0};
  Index row = 0;
  const auto meet = [&](double slack, const auto& name) {
    // NaN does not keep a limit.
    if (!(slack >= result.slack)) result = {std::isnan(slack) ? -kInfinity : slack, name(), row};
  };
  for (; row < motion.q.rows(); ++row) {
    const VectorXd q = motion.q.row(row), qd = motion.qd.row(row), qdd = motion.qdd.row(row);
    for (int j = 0; j < n(); ++j) {
      meet(1.0 - std::abs(qd[j]) / velocity[j], [&] { return "velocity of " + joint_name(robot, j); });
      meet(1.0 - std::abs(qdd[j]) / acceleration[j],
           [&] { return "acceleration of " + joint_name(robot, j); });
    }
    const LinkFrames frames(robot, q);
    const double slack = pose_slack(frames, q, nullptr);
    meet(slack, [&] {
      std::string what;
      (void)pose_slack(frames, q, &what);
      return what;
    });
    for (const SpeedPoint& point : points) {
      const double speed = frames.velocity(point.link, frames.at(point.link, point.point), qd).norm();
      meet(1.0 - speed / tool_speed, [&] { return point.name; });
    }
    if (result.slack < enough) return result;
    const VectorXd tau = torque_without_coulomb(q, qd, qdd);
    for (int j = 0; j < n(); ++j) {
      meet(1.0 - (std::abs(tau[j]) + coulomb[j]) / torque[j],
           [&] { return "torque of " + joint_name(robot, j); });
    }
    if (result.slack < enough) return result;
  }
  return result;
}

InSpace LimitCheck::in_space(const VectorXd& q, const VectorXd& qd) const {
  const LinkFrames frames(robot, q);
  InSpace space{kInfinity, kInfinity, kInfinity, kInfinity, kInfinity, 0.0, ""};
  for (const Wall& wall : walls) {
    double& least = wall.is_floor ? space.height : space.box_distance;
    const double base = wall.is_floor ? limits.floor.value_or(0.0) : 0.0;
    least = std::min(least, base + limits.clearance + wall.slack(frames));
  }
  const auto& capsules = limits.arm.capsules;
  for (const collision::CapsulePair& pair : limits.arm.pairs) {
    const Capsule &first = capsules[static_cast<std::size_t>(pair.first)],
                  &second = capsules[static_cast<std::size_t>(pair.second)];
    const double distance = collision::distance(frames, first, second).distance;
    space.link_spare = std::min(space.link_spare, distance - pair.clearance);
    if (distance >= space.link_distance) continue;
    space.link_distance = distance;
    space.closest_links = first.name + ", " + second.name;
  }
  for (const collision::GuardedObstacle& guarded : limits.arm.guarded) {
    const auto found = collision::distance(frames, capsules[static_cast<std::size_t>(guarded.capsule)],
                                           limits.obstacles[static_cast<std::size_t>(guarded.obstacle)]);
    space.obstacle_distance = std::min(space.obstacle_distance, found.distance);
  }
  for (int j = 1; j < n(); ++j) {
    space.speed =
        std::max(space.speed, frames.velocity(j, frames.origin[static_cast<std::size_t>(j)], qd).norm());
  }
  const Vector3d tip = vector_of(robot.tip_position),
                 tool = tip + matrix_of(robot.tip_rotation) * limits.tool;
  for (const Vector3d& point : {tip, tool}) {
    space.speed = std::max(space.speed, frames.velocity(n() - 1, frames.at(n() - 1, point), qd).norm());
  }
  for (double* none : {&space.link_distance, &space.link_spare, &space.obstacle_distance, &space.height,
                       &space.box_distance}) {
    if (!std::isfinite(*none)) *none = std::nan("");
  }
  return space;
}

LimitUse LimitCheck::use_of(const Samples& motion, const Eigen::MatrixXd& tau) const {
  LimitUse use;
  use.velocity = use.acceleration = use.torque = use.position = VectorXd::Zero(n());
  use.lowest = VectorXd::Constant(n(), kInfinity);
  use.highest = -use.lowest;
  use.lowest_height = use.box_distance = use.link_distance = use.obstacle_distance = std::nan("");
  for (Index i = 0; i < motion.q.rows(); ++i) {
    const VectorXd q = motion.q.row(i), qd = motion.qd.row(i), qdd = motion.qdd.row(i);
    use.lowest = use.lowest.cwiseMin(q);
    use.highest = use.highest.cwiseMax(q);
    use.velocity = use.velocity.cwiseMax(qd.cwiseAbs());
    use.acceleration = use.acceleration.cwiseMax(qdd.cwiseAbs());
    use.torque = use.torque.cwiseMax(
        (tau.rows() > 0 ? VectorXd(tau.row(i)) : dynamics_.joint_torque(q, qd, qdd)).cwiseAbs());
    const InSpace space = in_space(q, qd);
    // fmin: a NaN says that there is nothing to be near to.
    use.lowest_height = std::fmin(use.lowest_height, space.height);
    use.box_distance = std::fmin(use.box_distance, space.box_distance);
    use.obstacle_distance = std::fmin(use.obstacle_distance, space.obstacle_distance);
    use.tool_speed = std::max(use.tool_speed, space.speed);
    if (std::isnan(use.link_distance) || space.link_distance < use.link_distance) {
      use.link_distance = space.link_distance;
      use.closest_links = space.closest_links;
    }
  }
  const VectorXd range = 0.5 * (limits.upper - limits.lower);
  use.position = (use.highest - middle).cwiseMax(middle - use.lowest).cwiseQuotient(range);
  const Closest nearest = closest(motion, -kInfinity);
  use.inside = nearest.slack >= 0.0;
  use.worst = nearest.what;
  return use;
}

Closest LimitCheck::closest_at_rest(const VectorXd& q) const {
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(1, q.size());
  return closest({q.transpose(), none, none}, -kInfinity);
}

}  // namespace heft::excite
