/// Paths: splines through waypoints and through what a log holds.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/retime/retime.hpp"

namespace heft::retime {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Distance of two points of a log's path [rad, m]: at encoder steps of 1e-4 rad the spline's curvature errs by 1 rad/rad².
constexpr double kSpacing = 0.02;
/// Most points of a log's path; beyond, the spacing grows.
constexpr Index kMostPoints = 1500;
/// A log whose positions stay within this of one another stands still [rad, m].
constexpr double kStandstill = 2.0 * kSpacing;
/// A row further from the chord than this share of the spacing gets a point of its own: the tip of a reversal.
constexpr double kCorner = 0.1;
/// Positions may exceed a joint's range by rounding and encoder steps [rad, m].
constexpr double kRangeTolerance = 1e-3;
/// Places between two points at which a path is looked at.
constexpr int kSteps = 16;

/// Second derivatives at the points of a cubic spline, 0 at both ends (tridiagonal elimination).
MatrixXd spline_curvature(const VectorXd& s, const MatrixXd& points) {
  const Index last = s.size() - 1;
  MatrixXd second = MatrixXd::Zero(points.rows(), points.cols());
  VectorXd ratio = VectorXd::Zero(points.rows());
  for (Index k = 1; k < last; ++k) {
    const double before = s[k] - s[k - 1], after = s[k + 1] - s[k];
    const double pivot = 2.0 * (before + after) - before * ratio[k - 1];
    ratio[k] = after / pivot;
    const auto bend =
        6.0 * ((points.row(k + 1) - points.row(k)) / after - (points.row(k) - points.row(k - 1)) / before);
    second.row(k) = (bend - before * second.row(k - 1)) / pivot;
  }
  for (Index k = last - 1; k >= 1; --k) second.row(k) -= ratio[k] * second.row(k + 1);
  return second;
}

Path spline(MatrixXd points) {
  Path path;
  path.s = VectorXd::Zero(points.rows());
  for (Index k = 1; k < points.rows(); ++k)
    path.s[k] = path.s[k - 1] + (points.row(k) - points.row(k - 1)).norm();
  path.curvature = spline_curvature(path.s, points);
  path.points = std::move(points);
  return path;
}

/// Of a point from the line between two others.
double distance_from_chord(const VectorXd& point, const VectorXd& from, const VectorXd& to) {
  const VectorXd way = to - from;
  const double along = std::clamp((point - from).dot(way) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
  return (point - from - along * way).norm();
}

/// Smallest distance of a point from a line through the rows from `first` to `last`.
double distance_from_rows(const VectorXd& point, const MatrixXd& rows, Index first, Index last) {
  double nearest = (point - rows.row(first).transpose()).norm();
  for (Index k = first; k < last; ++k)
    nearest = std::min(nearest, distance_from_chord(point, rows.row(k), rows.row(k + 1)));
  return nearest;
}

/// Straight lines between the rows, each corner cut by a parabola from `rounding` before it to `rounding` behind it, as points so
/// close that a spline through them stays there.
MatrixXd rounded(const MatrixXd& corners, double rounding) {
  constexpr int kOnCorner = 16, kMostOnLine = 200;
  std::vector<VectorXd> points{corners.row(0)};
  const auto line_to = [&](const VectorXd& to) {
    const VectorXd from = points.back();
    const double way = (to - from).norm();
    if (way < 1e-9) return;
    const int count = std::clamp(static_cast<int>(std::ceil(8.0 * way / rounding)), 1, kMostOnLine);
    for (int i = 1; i <= count; ++i) points.emplace_back(from + (to - from) * i / count);
  };
  for (Index k = 1; k + 1 < corners.rows(); ++k) {
    const VectorXd corner = corners.row(k), in = corner - corners.row(k - 1).transpose(),
                   out = corners.row(k + 1).transpose() - corner;
    const double reach = std::min({rounding, 0.5 * in.norm(), 0.5 * out.norm()});
    const VectorXd begin = corner - in.normalized() * reach, end = corner + out.normalized() * reach;
    line_to(begin);
    for (int i = 1; i <= kOnCorner; ++i) {
      const double b = static_cast<double>(i) / kOnCorner, a = 1.0 - b;
      const VectorXd point = a * a * begin + 2.0 * a * b * corner + b * b * end;
      if ((point - points.back()).norm() > 1e-9) points.push_back(point);
    }
  }
  line_to(corners.row(corners.rows() - 1));
  MatrixXd all(static_cast<Index>(points.size()), corners.cols());
  for (Index k = 0; k < all.rows(); ++k) all.row(k) = points[static_cast<std::size_t>(k)];
  return all;
}

void refuse_outside(const model::Robot& robot, const Path& path) {
  VectorXd q, dq, ddq;
  for (Index k = 0; k + 1 < path.s.size(); ++k) {
    for (int look = 0; look <= kSteps; ++look) {
      path.evaluate(path.s[k] + (path.s[k + 1] - path.s[k]) * look / kSteps, q, dq, ddq);
      for (Index j = 0; j < q.size(); ++j) {
        const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
        if (q[j] >= joint.lower - kRangeTolerance && q[j] <= joint.upper + kRangeTolerance) continue;
        // More than a turn, and inside the limits as an angle in degrees.
        const double in_degrees = q[j] * std::numbers::pi / 180.0;
        const bool degrees = joint.joint.type == JointType::kRevolute &&
                             std::abs(q[j]) > 2.0 * std::numbers::pi && in_degrees >= joint.lower &&
                             in_degrees <= joint.upper;
        throw DataError(fmt::format(
            "{}: joint {} ({}): the path through the points reaches {:.4g} between points {} and {}; expected {:.4g} to "
            "{:.4g} [rad, m]; {}",
            path.source, j + 1, joint.name, q[j], k + 1, k + 2, joint.lower, joint.upper,
            degrees
                ? "positions in degrees are to be multiplied by pi/180"
                : "move these points, add one between them, or take straight lines with rounded corners (--rounding)"));
      }
    }
  }
}

/// Rows of a log that the path goes through.
struct Picked {
  std::vector<Index> rows;
  double spacing{kSpacing};
};

/// First to last row of the motion: standstill at the ends of a log is left out where it is more than a slow start or stop.
std::pair<Index, Index> moving_rows(const data::Log& log) {
  constexpr double kLeft = 0.1 * kSpacing, kStart = 0.5;  // [rad, m], [s]
  const Index end = log.num_samples() - 1;
  Index first = 0, last = end;
  while (first < last && (log.q.row(first + 1) - log.q.row(0)).norm() < kLeft) ++first;
  while (last > first && (log.q.row(last - 1) - log.q.row(end)).norm() < kLeft) --last;
  if (log.time[first] - log.time[0] < kStart) first = 0;
  if (log.time[end] - log.time[last] < kStart) last = end;
  return {first, last};
}

Picked pick_rows(const data::Log& log, Index first, Index last, double spacing) {
  Picked picked{{first}, spacing};
  const auto add = [&](Index to) {
    const Index from = picked.rows.back();
    Index corner = from;
    double furthest = kCorner * spacing;
    for (Index row = from + 1; row < to; ++row) {
      const double distance = distance_from_chord(log.q.row(row), log.q.row(from), log.q.row(to));
      if (distance > furthest) furthest = distance, corner = row;
    }
    if (corner != from) {
      // Points of very different distances would bend the spline.
      const bool close = (log.q.row(corner) - log.q.row(from)).norm() < 0.5 * spacing;
      if (close && picked.rows.size() > 1) picked.rows.pop_back();
      picked.rows.push_back(corner);
    }
    picked.rows.push_back(to);
  };
  for (Index row = first + 1; row < last; ++row) {
    if ((log.q.row(row) - log.q.row(picked.rows.back())).norm() >= spacing) add(row);
  }
  // The last point is the log's; one just before it would bend the spline.
  if (picked.rows.size() > 1 && (log.q.row(last) - log.q.row(picked.rows.back())).norm() < 0.5 * spacing)
    picked.rows.pop_back();
  if ((log.q.row(last) - log.q.row(picked.rows.back())).norm() > 0.0) add(last);
  return picked;
}

/// Largest distance between the path and the log's rows, from either side.
double deviation_of(const Path& path, const data::Log& log, const std::vector<Index>& rows) {
  constexpr Index kSamples = 8;
  const Index segments = path.s.size() - 1;
  MatrixXd places(kSamples * segments + 1, log.q.cols());
  VectorXd q, dq, ddq;
  for (Index i = 0; i < places.rows(); ++i) {
    const Index k = std::min(i / kSamples, segments - 1);
    const double share = static_cast<double>(i - kSamples * k) / kSamples;
    path.evaluate(path.s[k] + share * (path.s[k + 1] - path.s[k]), q, dq, ddq);
    places.row(i) = q;
  }
  double largest = 0.0;
  for (Index k = 0; k < segments; ++k) {
    const Index before = std::max<Index>(k - 1, 0), after = std::min(k + 2, segments);
    const Index first = rows[static_cast<std::size_t>(before)], last = rows[static_cast<std::size_t>(after)];
    for (Index i = kSamples * k; i < kSamples * (k + 1); ++i)
      largest = std::max(largest, distance_from_rows(places.row(i), log.q, first, last));
    for (Index row = rows[static_cast<std::size_t>(k)]; row < rows[static_cast<std::size_t>(k + 1)]; ++row) {
      largest =
          std::max(largest, distance_from_rows(log.q.row(row), places, kSamples * before, kSamples * after));
    }
  }
  return largest;
}

void refuse_other_joints(const model::Robot& robot, const std::string& source, Index joints) {
  if (joints == robot.num_joints()) return;
  throw DataError(
      fmt::format("{}: found {} joints; expected {} of robot \"{}\"; give positions of this robot", source,
                  joints, robot.num_joints(), robot.name));
}

}  // namespace

void Path::evaluate(double at, VectorXd& q, VectorXd& dq, VectorXd& ddq) const {
  const auto next = std::upper_bound(s.begin(), s.end(), at);
  const Index k = std::clamp<Index>(next - s.begin() - 1, 0, s.size() - 2);
  const double h = s[k + 1] - s[k], b = std::clamp((at - s[k]) / h, 0.0, 1.0), a = 1.0 - b;
  q = a * points.row(k) + b * points.row(k + 1) +
      h * h / 6.0 * ((a * a * a - a) * curvature.row(k) + (b * b * b - b) * curvature.row(k + 1));
  dq = (points.row(k + 1) - points.row(k)) / h +
       h / 6.0 * ((1.0 - 3.0 * a * a) * curvature.row(k) + (3.0 * b * b - 1.0) * curvature.row(k + 1));
  ddq = a * curvature.row(k) + b * curvature.row(k + 1);
}

Path through(const model::Robot& robot, const data::Log& waypoints, double rounding) {
  const std::string source = waypoints.path.empty() ? "waypoints" : waypoints.path;
  refuse_other_joints(robot, source, waypoints.q.cols());
  if (waypoints.num_samples() < 2) {
    throw DataError(fmt::format("{}: found {} waypoint; expected two or more; add rows", source,
                                waypoints.num_samples()));
  }
  for (Index k = 0; k < waypoints.q.rows(); ++k) {
    if (waypoints.q.row(k).allFinite()) continue;
    throw DataError(
        fmt::format("{}: point {}: found a position that is not finite; expected numbers [rad, m]; repair it",
                    source, k + 1));
  }
  for (Index k = 0; k + 1 < waypoints.q.rows(); ++k) {
    // Below, the path's direction would be rounding.
    if ((waypoints.q.row(k + 1) - waypoints.q.row(k)).norm() > 1e-6) continue;
    throw DataError(fmt::format(
        "{}: points {} and {} are the same; expected another position in each row, as a path has no time to wait; remove one",
        source, k + 1, k + 2));
  }
  if (!(rounding >= 0.0) || !std::isfinite(rounding)) {
    throw DataError(fmt::format("rounding: found {}; expected a distance of at least 0 [rad, m]", rounding));
  }
  Path path = spline(rounding > 0.0 ? rounded(waypoints.q, rounding) : waypoints.q);
  path.source = source;
  VectorXd q, dq, ddq;
  for (Index k = 0; k + 1 < path.s.size(); ++k) {
    for (int look = 1; look < kSteps; ++look) {
      path.evaluate(path.s[k] + (path.s[k + 1] - path.s[k]) * look / kSteps, q, dq, ddq);
      path.deviation =
          std::max(path.deviation, distance_from_rows(q, waypoints.q, 0, waypoints.q.rows() - 1));
    }
  }
  refuse_outside(robot, path);
  return path;
}

Path along(const model::Robot& robot, const data::LogSource& log) {
  std::vector<std::string> notes;
  const data::Log rows = data::read(log, &notes);
  refuse_other_joints(robot, log.path, rows.q.cols());
  const VectorXd travel = rows.q.colwise().maxCoeff() - rows.q.colwise().minCoeff();
  const auto [first, last] = moving_rows(rows);
  Picked picked = pick_rows(rows, first, last, kSpacing);
  while (static_cast<Index>(picked.rows.size()) > kMostPoints)
    picked = pick_rows(rows, first, last, 2.0 * picked.spacing);
  if (!(travel.maxCoeff() > kStandstill) || picked.rows.size() < 2) {
    throw DataError(fmt::format(
        "{}: no joint moves more than {} rad or m; expected a motion to take the path from; give a log in which the arm moves",
        log.path, kStandstill));
  }
  // The standstill that was left out began and ended there.
  picked.rows.front() = 0;
  picked.rows.back() = rows.num_samples() - 1;
  MatrixXd points(static_cast<Index>(picked.rows.size()), rows.q.cols());
  for (Index k = 0; k < points.rows(); ++k)
    points.row(k) = rows.q.row(picked.rows[static_cast<std::size_t>(k)]);
  Path path = spline(std::move(points));
  path.source = log.path;
  path.from_log = true;
  path.duration = rows.time[last] - rows.time[first];
  path.deviation = deviation_of(path, rows, picked.rows);
  path.notes = std::move(notes);
  refuse_outside(robot, path);
  return path;
}

}  // namespace heft::retime
