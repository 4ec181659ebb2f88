#include "planner.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::retime {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Intervals of the path: as many, but at least so many from point to point, where d³q/ds³ jumps.
constexpr Index kIntervals = 3000, kFewestFromPointToPoint = 4;
/// How many times more there are from the first point to the second and up to the last one: the arm starts from rest there.
constexpr Index kMoreAtEnds = 4;
constexpr int kMostSweeps = 80;
/// The duration changes by less from sweep to sweep: friction is that of the motion.
constexpr double kSettled = 1e-9;
/// Sweeps before the motion is checked although it has not settled.
constexpr int kPatience = 30;
/// Limits are lowered by this share from the outset, which the check between places does not see.
constexpr double kRounding = 1e-6;
/// Places at which each interval is checked, as shares of it.
constexpr double kLooks[] = {0.0, 0.25, 0.5, 0.75, 1.0};
/// Speeds that the first sweep takes friction at, as a share of what velocities allow: friction that is taken too slow leaves too
/// little speed, which the next sweep mends; one taken too fast may leave no motion at all.
constexpr double kFirstSpeed = 0.1;

/// Adds ± (a u + b x + c) ≤ limit for a motion whose ṡ² is x + ahead·u there.
void add_both(double a, double b, double c, double limit, double ahead, std::vector<Line>& lines) {
  if (!std::isfinite(limit)) return;
  a = (a + b * ahead) / limit, b /= limit, c /= limit;
  lines.push_back({a, b, 1.0 - c});
  lines.push_back({-a, -b, 1.0 + c});
}

/// Places on a path, its points among them, denser towards both ends.
std::vector<double> places_of(const Path& path) {
  const Index segments = path.s.size() - 1;
  const Index each = std::max(kFewestFromPointToPoint, kIntervals / (segments + 2 * (kMoreAtEnds - 1)));
  std::vector<double> places;
  for (Index k = 0; k < segments; ++k) {
    const bool first = k == 0, last = k == segments - 1;
    const Index count = first && last ? kIntervals : first || last ? kMoreAtEnds * each : each;
    for (Index i = 0; i < count; ++i) {
      double share = static_cast<double>(i) / static_cast<double>(count);
      if (first && last) {
        const double turn = 2.0 * std::numbers::pi;
        share -= 0.9 * std::sin(turn * share) / turn;
      } else if (first) {
        share *= share;
      } else if (last) {
        share *= 2.0 - share;
      }
      places.push_back(path.s[k] + share * (path.s[k + 1] - path.s[k]));
    }
  }
  places.push_back(path.length());
  return places;
}

/// A cut limit after it was exceeded: lowered by a little more, so that few sweeps are needed.
double cut_more(double cut, double excess) {
  return excess > 0.0 ? 1.0 - (1.0 - cut) / (1.0 + 1.1 * excess + 1e-7) : cut;
}

}  // namespace

Planner::Planner(const model::Dynamics& dynamics, const Path& path, const JointLimits& limits)
    : dynamics_(dynamics), path_(path), limits_(limits) {
  const std::vector<double> places = places_of(path);
  s_ = Eigen::Map<const VectorXd>(places.data(), static_cast<Index>(places.size()));
  const Index count = s_.size() - 1;
  places_.reserve(static_cast<std::size_t>(count) + 1);
  for (const double s : s_) places_.push_back(place_at(s));
  cuts_.torque = cuts_.acceleration = Eigen::MatrixXd::Constant(count, dynamics.num_joints(), kRounding);
  cuts_.velocity = VectorXd::Constant(count + 1, kRounding);
}

Planner::Place Planner::place_at(double s) const {
  Place place;
  path_.evaluate(s, place.q, place.dq, place.ddq);
  return place;
}

VectorXd Planner::torque(const Place& place, double x, double u) const {
  x = std::max(x, smallest_);
  return dynamics_.joint_torque(place.q, place.dq * std::sqrt(x), place.dq * u + place.ddq * x);
}

void Planner::refuse_what_cannot_be_held() const {
  const VectorXd rest = VectorXd::Zero(dynamics_.num_joints());
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const VectorXd held = dynamics_.joint_torque(places_[i].q, rest, rest);
    for (Index j = 0; j < held.size(); ++j) {
      if (std::abs(held[j]) <= limits_.torque[j]) continue;
      throw NotIdentifiableError(fmt::format(
          "{}: joint {} ({}) cannot hold the arm at {:.3g} of the path: it takes {:.4g} N·m (N), expected at most {:.4g} with "
          "the margin kept; take another path, a lighter load or a smaller margin",
          path_.source, j + 1, dynamics_.robot().joints[static_cast<std::size_t>(j)].name,
          s_[static_cast<Index>(i)] / path_.length(), held[j], limits_.torque[j]));
    }
  }
}

void Planner::refuse_stop(Index at) const {
  const Place& place = places_[static_cast<std::size_t>(at)];
  const VectorXd needed = torque(place, 0.0, 0.0);
  Index joint = 0;
  (needed.cwiseAbs().array() / limits_.torque.array()).maxCoeff(&joint);
  throw NotIdentifiableError(fmt::format(
      "{}: no motion keeps all limits at {:.3g} of the path; nearest to its limit is joint {} ({}), which takes {:.4g} N·m (N) of "
      "{:.4g} to move slowly there; take another path, a lighter load or a smaller margin",
      path_.source, s_[at] / path_.length(), joint + 1,
      dynamics_.robot().joints[static_cast<std::size_t>(joint)].name, needed[joint], limits_.torque[joint]));
}

VectorXd Planner::fastest() const {
  VectorXd most(s_.size());
  for (Index i = 0; i < s_.size(); ++i) {
    const VectorXd& dq = places_[static_cast<std::size_t>(i)].dq;
    // No arm passes its whole path in a microsecond; where nothing moves for a moment that is the only bound.
    double speed = 1e6 * path_.length();
    for (Index j = 0; j < dq.size(); ++j) {
      if (dq[j] != 0.0) speed = std::min(speed, limits_.velocity[j] / std::abs(dq[j]));
    }
    most[i] = std::pow(speed * (1.0 - cuts_.velocity[i]), 2);
  }
  return most;
}

void Planner::add_lines(const Place& place, double x, double u, double ahead, Index interval,
                        std::vector<Line>& lines) const {
  // Tangent of the torque; exact for rigid bodies whatever the steps.
  constexpr double kStep = 1e-3;
  x = std::max(x, smallest_);
  const double du = kStep * std::max(1.0, std::abs(u)), dx = kStep * x;
  const VectorXd tau = torque(place, x, u);
  const VectorXd by_u = (torque(place, x, u + du) - tau) / du;
  const VectorXd by_x = (torque(place, x + dx, u) - torque(place, x, u)) / dx;
  for (Index j = 0; j < tau.size(); ++j) {
    const double rest = tau[j] - by_u[j] * u - by_x[j] * x;
    add_both(by_u[j], by_x[j], rest, limits_.torque[j] * (1.0 - cuts_.torque(interval, j)), ahead, lines);
    add_both(place.dq[j], place.ddq[j], 0.0,
             limits_.acceleration[j] * (1.0 - cuts_.acceleration(interval, j)), ahead, lines);
  }
}

Intervals Planner::intervals(const VectorXd& x, const VectorXd& u) const {
  const Index count = s_.size() - 1;
  Intervals all{s_, std::vector<std::vector<Line>>(static_cast<std::size_t>(count)), fastest()};
  for (Index i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    add_lines(places_[k], x[i], u[i], 0.0, i, all.lines[k]);
    add_lines(places_[k + 1], x[i + 1], u[i], 2.0 * (s_[i + 1] - s_[i]), i, all.lines[k]);
  }
  return all;
}

void Planner::look(Index interval, double share, Plan& plan, Cuts& excess) const {
  const Index i = interval;
  const Sweep& motion = plan.motion;
  const double x = motion.x[i] + share * (motion.x[i + 1] - motion.x[i]), u = motion.u[i];
  const Place place = place_at(s_[i] + share * (s_[i + 1] - s_[i]));
  const VectorXd tau = torque(place, x, u);
  Nearest& nearest = plan.nearest[static_cast<std::size_t>(i)];
  const auto take = [&](double use, double& largest, Index joint, Limit limit, double& over) {
    largest = std::max(largest, use);
    if (use > nearest.use) nearest = {use, static_cast<int>(joint), limit};
    plan.excess = std::max(plan.excess, use - 1.0);
    over = std::max(over, use - 1.0);
  };
  for (Index j = 0; j < tau.size(); ++j) {
    take(std::abs(tau[j]) / limits_.torque[j], plan.torque_use[j], j, Limit::kTorque, excess.torque(i, j));
    take(std::abs(place.dq[j] * u + place.ddq[j] * x) / limits_.acceleration[j], plan.acceleration_use[j], j,
         Limit::kAcceleration, excess.acceleration(i, j));
    double over = 0.0;
    take(std::abs(place.dq[j]) * std::sqrt(x) / limits_.velocity[j], plan.velocity_use[j], j,
         Limit::kVelocity, over);
    excess.velocity[i] = std::max(excess.velocity[i], over);
    excess.velocity[i + 1] = std::max(excess.velocity[i + 1], over);
  }
}

void Planner::check(Plan& plan) {
  const Index count = s_.size() - 1, n = dynamics_.num_joints();
  plan.velocity_use = plan.acceleration_use = plan.torque_use = VectorXd::Zero(n);
  plan.nearest.assign(static_cast<std::size_t>(count), {});
  plan.excess = 0.0;
  plan.lowered =
      std::max({cuts_.torque.maxCoeff(), cuts_.acceleration.maxCoeff(), cuts_.velocity.maxCoeff()});
  Cuts excess{Eigen::MatrixXd::Zero(count, n), Eigen::MatrixXd::Zero(count, n), VectorXd::Zero(count + 1)};
  for (Index i = 0; i < count; ++i) {
    for (const double share : kLooks) look(i, share, plan, excess);
  }
  cuts_.torque = cuts_.torque.binaryExpr(excess.torque, &cut_more);
  cuts_.acceleration = cuts_.acceleration.binaryExpr(excess.acceleration, &cut_more);
  cuts_.velocity = cuts_.velocity.binaryExpr(excess.velocity, &cut_more);
}

Plan Planner::plan() {
  refuse_what_cannot_be_held();
  const Index count = s_.size() - 1;
  VectorXd x = kFirstSpeed * kFirstSpeed * fastest().cwiseMin(std::pow(path_.length() / kFirstSpeed, 2)),
           u = VectorXd::Zero(count);
  x[0] = x[count] = 0.0;
  smallest_ = 1e-9 * x.maxCoeff();
  Plan plan;
  double before = 0.0;
  Index stopped = -1;
  for (int sweeps = 1; sweeps <= kMostSweeps; ++sweeps) {
    Sweep found = sweep(intervals(x, u));
    if (found.stopped >= 0) {
      // The tangents of a motion too fast may leave none: those of a slower one.
      stopped = found.stopped;
      x *= 0.1, u.setZero(), before = 0.0;
      if (!(x.maxCoeff() > 10.0 * smallest_)) refuse_stop(stopped);
      continue;
    }
    plan.motion = std::move(found);
    plan.sweeps = sweeps;
    x = plan.motion.x, u = plan.motion.u;
    smallest_ = 1e-9 * x.maxCoeff();
    const bool settled = std::abs(plan.motion.duration - before) < kSettled * plan.motion.duration;
    before = plan.motion.duration;
    if (!settled && sweeps < kPatience) continue;
    check(plan);
    if (plan.unlowered == 0.0) plan.unlowered = plan.motion.duration;
    if (!(plan.excess > 0.0)) return plan;
  }
  if (plan.sweeps == 0) refuse_stop(stopped);
  return plan;
}

}  // namespace heft::retime
