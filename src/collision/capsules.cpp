/// Capsules of an arm and the pairs of them that can collide.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/collision/collision.hpp"
#include "heft/host/decompositions.hpp"

namespace heft::collision {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using model::LinkShape;

constexpr double kThinnest = 0.015, kThickest = 0.06;  // radius of an estimated capsule over the arm's length

Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

/// Corners of a box or a mesh in the link frame.
Matrix3Xd corners_of(const LinkShape& shape) {
  const Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.rotation.data());
  Matrix3Xd points(3, shape.kind == LinkShape::Kind::kBox ? 8 : static_cast<Index>(shape.corners.size()));
  for (Index k = 0; k < points.cols(); ++k) {
    if (shape.kind == LinkShape::Kind::kBox) {
      for (int a = 0; a < 3; ++a)
        points(a, k) = 0.5 * shape.size[static_cast<std::size_t>(a)] * ((k >> a & 1) != 0 ? 1.0 : -1.0);
    } else {
      points.col(k) = vector_of(shape.corners[static_cast<std::size_t>(k)]);
    }
  }
  return (R * points).colwise() + vector_of(shape.position);
}

Capsule capsule_of(const LinkShape& shape) {
  const Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.rotation.data());
  Capsule capsule;
  if (shape.kind == LinkShape::Kind::kCylinder || shape.kind == LinkShape::Kind::kSphere) {
    const double half = shape.kind == LinkShape::Kind::kCylinder ? 0.5 * shape.size[1] : 0.0;
    capsule.a = vector_of(shape.position) - half * R.col(2);
    capsule.b = vector_of(shape.position) + half * R.col(2);
    capsule.radius = shape.size[0];
  } else {
    const Matrix3Xd points = corners_of(shape);
    Matrix3Xd directions = R;
    if (shape.kind == LinkShape::Kind::kMesh) {
      const Matrix3Xd about = points.colwise() - points.rowwise().mean();
      directions.conservativeResize(3, 6);
      directions.rightCols(3) = eigensystem_of(about * about.transpose()).vectors;
    }
    capsule = capsule_around(points, directions);
  }
  capsule.link = shape.link;
  capsule.name = shape.link_name;
  return capsule;
}

/// Whether all of `inner` is inside `outer`, to a micrometre: balls about the ends of a segment decide.
bool contains(const Capsule& outer, const Capsule& inner) {
  const Vector3d d = outer.b - outer.a;
  const double length = d.squaredNorm();
  for (const Vector3d& end : {inner.a, inner.b}) {
    const double t = length > 0.0 ? std::clamp(d.dot(end - outer.a) / length, 0.0, 1.0) : 0.0;
    if ((end - outer.a - t * d).norm() + inner.radius > outer.radius + 1e-6) return false;
  }
  return true;
}

/// Radius of a uniform cylinder with the link's mass and smallest principal moment, within bounds.
double estimated_radius(const InertialParameters<double>& p, double length) {
  double radius = 0.5 * (kThinnest + kThickest) * length;
  if (p[kMass] > 0.0) {
    const Vector3d c = Vector3d(p[kMcx], p[kMcy], p[kMcz]) / p[kMass];
    Matrix3d inertia;
    inertia << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
    inertia -= p[kMass] * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
    const double least = eigenvalues_of(inertia)[0];
    // I = m r²/2 about the axis of a long cylinder
    if (least > 0.0) radius = std::sqrt(2.0 * least / p[kMass]);
  }
  return std::clamp(radius, kThinnest * length, kThickest * length);
}

/// A capsule from the link's joint to the next one, or to the tip.
Capsule estimated_capsule(const model::Robot& robot, int link, double length) {
  const int n = robot.num_joints();
  Capsule capsule;
  capsule.link = link;
  capsule.name = link < 0 ? robot.base_link : robot.joints[static_cast<std::size_t>(link)].link_name;
  capsule.radius = link < 0 ? kThinnest * length
                            : estimated_radius(robot.joints[static_cast<std::size_t>(link)].link, length);
  capsule.b = link + 1 < n ? vector_of(robot.joints[static_cast<std::size_t>(link + 1)].joint.position)
                           : vector_of(robot.tip_position);
  return capsule;
}

}  // namespace

Capsule capsule_around(const Matrix3Xd& points, const Matrix3Xd& directions) {
  Capsule best;
  double least = std::numeric_limits<double>::infinity();
  for (Index k = 0; k < directions.cols(); ++k) {
    const Vector3d axis = directions.col(k).normalized();
    // The axis goes through the middle of the extent across it.
    const Matrix3Xd across = points - axis * (axis.transpose() * points);
    const Vector3d middle = 0.5 * (across.rowwise().minCoeff() + across.rowwise().maxCoeff());
    const Vector3d centre = middle - axis * axis.dot(middle);
    const VectorXd off = (across.colwise() - centre).colwise().norm();
    const VectorXd along = (axis.transpose() * points).transpose();
    const double radius = off.maxCoeff();
    // A ball about an end reaches further along the axis than its centre by √(r² − off²).
    const VectorXd reach = (radius * radius - off.array().square()).max(0.0).sqrt();
    double low = (along + reach).minCoeff(), high = (along - reach).maxCoeff();
    if (low > high) low = high = 0.5 * (low + high);
    const double volume = radius * radius * ((high - low) + 4.0 / 3.0 * radius);
    if (volume >= least) continue;
    least = volume;
    best.radius = radius;
    best.a = centre + low * axis;
    best.b = centre + high * axis;
  }
  // Where one ball was put between two bounds, it may miss a point.
  for (Index i = 0; i < points.cols(); ++i) {
    const Vector3d d = best.b - best.a;
    const double square = d.squaredNorm();
    const double t = square > 0.0 ? std::clamp(d.dot(points.col(i) - best.a) / square, 0.0, 1.0) : 0.0;
    best.radius = std::max(best.radius, (points.col(i) - best.a - t * d).norm());
  }
  return best;
}

ArmCapsules arm_capsules(const model::Robot& robot, const std::vector<LinkShape>& shapes) {
  ArmCapsules arm;
  const double length = arm_length(robot);
  std::string estimated;
  for (int link = -1; link < robot.num_joints(); ++link) {
    std::vector<Capsule> found;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      const LinkShape& shape = shapes[k];
      if (shape.link != link || (shape.kind == LinkShape::Kind::kMesh && shape.corners.empty())) continue;
      found.push_back(capsule_of(shape));
      found.back().shapes = {static_cast<int>(k)};
    }
    // The largest first: what is inside another adds nothing.
    std::stable_sort(found.begin(), found.end(), [](const Capsule& l, const Capsule& r) {
      return (l.b - l.a).norm() + l.radius > (r.b - r.a).norm() + r.radius;
    });
    const std::size_t before = arm.capsules.size();
    for (const Capsule& capsule : found) {
      const auto outer =
          std::find_if(arm.capsules.begin() + static_cast<std::ptrdiff_t>(before), arm.capsules.end(),
                       [&](const Capsule& other) { return contains(other, capsule); });
      if (outer == arm.capsules.end()) {
        arm.capsules.push_back(capsule);
      } else {
        outer->shapes.push_back(capsule.shapes.front());
      }
    }
    if (!found.empty()) continue;
    arm.capsules.push_back(estimated_capsule(robot, link, length));
    estimated += (estimated.empty() ? "" : ", ") + arm.capsules.back().name;
  }
  if (!estimated.empty()) {
    arm.notes.push_back(
        fmt::format("{}: the description has no collision shapes that can be read; capsules were fitted from "
                    "the kinematics and inertias, check them",
                    estimated));
  }
  return arm;
}

void choose_pairs(const model::Robot& robot, const VectorXd& lower, const VectorXd& upper, double clearance,
                  const std::vector<BoxObstacle>& obstacles, ArmCapsules& arm) {
  constexpr int kPoses = 2000;
  arm.pairs.clear();
  arm.guarded.clear();
  arm.excluded.clear();
  std::vector<CapsulePair> candidates;
  std::set<std::pair<int, int>> neighbours;
  const auto count = static_cast<int>(arm.capsules.size());
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      const Capsule &first = arm.capsules[static_cast<std::size_t>(i)],
                    &second = arm.capsules[static_cast<std::size_t>(j)];
      if (first.link == second.link) continue;
      if (std::abs(first.link - second.link) > 1) {
        candidates.push_back({i, j, clearance});
      } else if (neighbours.insert({first.link, second.link}).second) {
        arm.excluded.push_back({first.name, second.name, "neighbours in the chain"});
      }
    }
  }
  std::vector<double> largest(candidates.size(), -std::numeric_limits<double>::infinity());
  // Capsules that no joint moves to another place: a robot may be mounted on its table.
  std::vector<bool> moves(arm.capsules.size(), false);
  const LinkFrames middle(robot, 0.5 * (lower + upper));
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  VectorXd q = 0.5 * (lower + upper);
  for (int pose = 0; pose < kPoses; ++pose) {
    const LinkFrames frames(robot, q);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const CapsulePair& pair = candidates[k];
      largest[k] = std::max(largest[k], distance(frames, arm.capsules[static_cast<std::size_t>(pair.first)],
                                                 arm.capsules[static_cast<std::size_t>(pair.second)])
                                            .distance);
    }
    for (std::size_t k = 0; k < moves.size(); ++k) {
      const Capsule& c = arm.capsules[k];
      moves[k] = moves[k] || (frames.at(c.link, c.a) - middle.at(c.link, c.a)).norm() > 1e-9 ||
                 (frames.at(c.link, c.b) - middle.at(c.link, c.b)).norm() > 1e-9;
    }
    for (Index j = 0; j < q.size(); ++j) q[j] = lower[j] + unit(random) * (upper[j] - lower[j]);
  }
  for (int k = 0; k < count; ++k) {
    for (int box = 0; moves[static_cast<std::size_t>(k)] && box < static_cast<int>(obstacles.size()); ++box)
      arm.guarded.push_back({k, box});
  }
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const CapsulePair& pair = candidates[k];
    if (largest[k] > 0.1 * clearance) {
      arm.pairs.push_back({pair.first, pair.second, std::min(clearance, 0.5 * largest[k])});
      continue;
    }
    arm.excluded.push_back({arm.capsules[static_cast<std::size_t>(pair.first)].name,
                            arm.capsules[static_cast<std::size_t>(pair.second)].name,
                            fmt::format("they touch in each of {} poses", kPoses)});
  }
}

}  // namespace heft::collision
