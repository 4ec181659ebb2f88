/// @file
/// Looks at a motion with nothing of the planner's: the URDF read with urdfdom, placed by KDL, distances of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>
#include <Eigen/Geometry>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "heft/excite/excite.hpp"
#include "heft/host/error.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/kdl.hpp"

namespace heft::excite {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

inline std::string path_of(const std::string& robot) {
  return std::string(HEFT_URDF_DIR) + "/" + robot + ".urdf";
}

/// A cylinder with flat ends; without length a ball.
struct Round {
  Eigen::Isometry3d placement;  ///< in the link frame
  double radius, length;
};

/// Distance of a point from a solid.
inline double distance(const Vector3d& p, const Round& round, const Eigen::Isometry3d& link) {
  const Vector3d local = (link * round.placement).inverse() * p;
  if (round.length == 0.0) return local.norm() - round.radius;
  const double across = std::max(0.0, local.head<2>().norm() - round.radius);
  const double along = std::max(0.0, std::abs(local.z()) - 0.5 * round.length);
  return std::hypot(across, along);
}

/// The arm through urdfdom and KDL.
class PlainArm {
 public:
  explicit PlainArm(const std::string& path) : chain_(test::kdl_chain_from_urdf(path)) {
    const auto model = ::urdf::parseURDFFile(path);
    bodies_.push_back(shapes_of(*model->getRoot()));
    for (unsigned k = 0; k < chain_.getNrOfSegments(); ++k)
      bodies_.push_back(shapes_of(*model->getLink(chain_.getSegment(k).getName())));
  }

  /// Smallest distance of links that are no neighbours. Cylinders here have a ball at each end: what is within the radius
  /// of a line. Points of one line, at most 4 mm apart, against the solids of the other: too large by 2 mm at most.
  double smallest_distance(const VectorXd& q) const {
    std::vector<Eigen::Isometry3d> links(1, Eigen::Isometry3d::Identity());
    KDL::ChainFkSolverPos_recursive fk(chain_);
    for (unsigned k = 1; k <= chain_.getNrOfSegments(); ++k) {
      KDL::Frame frame;
      fk.JntToCart(joints(q), frame, static_cast<int>(k));
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) T(r, c) = frame.M(r, c);
        T(r, 3) = frame.p[r];
      }
      links.push_back(T);
    }
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < links.size(); ++a) {
      for (std::size_t b = 0; b < links.size(); ++b) {
        if (a + 1 >= b && b + 1 >= a) continue;
        for (const Round& line : bodies_[a]) {
          const int points = 1 + static_cast<int>(std::ceil(line.length / 0.004));
          for (int i = 0; i <= points; ++i) {
            const Vector3d p = links[a] * line.placement *
                               Vector3d(0, 0, line.length * (static_cast<double>(i) / points - 0.5));
            for (const Round& solid : bodies_[b])
              least = std::min(least, distance(p, solid, links[b]) - line.radius);
            if (line.length == 0.0) break;
          }
        }
      }
    }
    return least;
  }

  double largest_speed(const VectorXd& q, const VectorXd& qd) const {
    KDL::ChainJntToJacSolver solver(chain_);
    double largest = 0.0;
    for (unsigned k = 1; k <= chain_.getNrOfSegments(); ++k) {
      KDL::Jacobian jacobian(chain_.getNrOfJoints());
      solver.JntToJac(joints(q), jacobian, static_cast<int>(k));
      largest = std::max(largest, (jacobian.data.topRows<3>() * qd).norm());
    }
    return largest;
  }

 private:
  KDL::JntArray joints(const VectorXd& q) const {
    KDL::JntArray array(static_cast<unsigned>(q.size()));
    array.data = q;
    return array;
  }

  static std::vector<Round> shapes_of(const ::urdf::Link& link) {
    std::vector<Round> shapes;
    for (const auto& collision : link.collision_array) {
      const ::urdf::Pose& pose = collision->origin;
      double x = 0, y = 0, z = 0, w = 1;
      pose.rotation.getQuaternion(x, y, z, w);
      Round round{Eigen::Isometry3d::Identity(), 0.0, 0.0};
      round.placement.linear() = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
      round.placement.translation() = Vector3d(pose.position.x, pose.position.y, pose.position.z);
      if (collision->geometry->type == ::urdf::Geometry::CYLINDER) {
        const auto& cylinder = dynamic_cast<const ::urdf::Cylinder&>(*collision->geometry);
        round.radius = cylinder.radius;
        round.length = cylinder.length;
      } else {
        round.radius = dynamic_cast<const ::urdf::Sphere&>(*collision->geometry).radius;
      }
      shapes.push_back(round);
    }
    return shapes;
  }

  KDL::Chain chain_;
  std::vector<std::vector<Round>> bodies_;  ///< base first
};

inline Options quick(std::uint64_t seed) {
  Options options;
  options.search.starts = 2;
  options.search.finalists = 1;
  options.search.iterations = 45;
  options.search.seed = seed;
  return options;
}

inline MotionLimits safe_limits(const model::Robot& robot, const std::string& path) {
  return limits_of(robot, {.shapes = urdf::load_shapes(path, robot)});
}

/// Looks at a simulated run with the plain arm.
inline void expect_safe(const std::string& name, const model::Robot& robot, const MotionLimits& limits,
                        const data::Log& log, const std::string& what) {
  const PlainArm arm(path_of(name));
  double least = std::numeric_limits<double>::infinity(), fastest = 0.0;
  for (Index i = 0; i < log.num_samples(); i += 5) {
    least = std::min(least, arm.smallest_distance(log.q.row(i)));
    fastest = std::max(fastest, arm.largest_speed(log.q.row(i), log.qd.row(i)));
  }
  EXPECT_GT(least, 0.002) << what << ": sampled points are up to 2 mm too far apart";
  EXPECT_LE(fastest, kToolSpeed) << what;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    EXPECT_GE(log.q.col(j).minCoeff(), std::max(joint.lower, limits.lower[j])) << what << j;
    EXPECT_LE(log.q.col(j).maxCoeff(), std::min(joint.upper, limits.upper[j])) << what << j;
    EXPECT_LE(log.qd.col(j).cwiseAbs().maxCoeff(), joint.velocity_limit) << what << j;
    EXPECT_LE(log.tau.col(j).cwiseAbs().maxCoeff(), joint.effort_limit) << what << j;
    if (joint.joint.type == JointType::kRevolute && joint.upper - joint.lower > 6.2832) {
      EXPECT_LE(log.q.col(j).cwiseAbs().maxCoeff(), 3.1416) << what << ": more than half a turn";
    }
  }
}

inline void design_and_look(const std::string& name, std::uint64_t seed) {
  const model::Robot robot = urdf::load_urdf(path_of(name));
  const MotionLimits limits = safe_limits(robot, path_of(name));
  const ExcitingMotion motion = design(robot, limits, quick(seed));
  ASSERT_TRUE(motion.rehearsal && motion.rehearsal->passed) << name << seed;
  expect_safe(name, robot, limits, motion.rehearsal->log, name + " seed " + std::to_string(seed) + " ");
}

}  // namespace heft::excite
