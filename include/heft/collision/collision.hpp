/// @file
/// Distances between the links of an arm, to the floor and to obstacles.
///
/// Two computations that can check each other: capsules around the links with distances in closed form and their
/// gradients, for searches (ArmCapsules); and the collision shapes themselves through FCL (ShapeDistance), for a
/// last check.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/collision/link_frames.hpp"
#include "heft/model/link_shape.hpp"
#include "heft/model/robot.hpp"

namespace heft::collision {

/// All points within `radius` of the segment from a to b.
struct Capsule {
  int link{-1};  ///< 0-based joint that moves it; −1: the base
  Eigen::Vector3d a{Eigen::Vector3d::Zero()}, b{Eigen::Vector3d::Zero()};  ///< in the link frame [m]
  double radius{0.0};                                                      ///< [m]
  std::string name;                                                        ///< of the link
  std::vector<int> shapes;  ///< indices of the link shapes it covers; none: fitted from the kinematics
};

/// Smallest capsule found around points: its axis is one of the directions given, its radius the largest distance
/// from that axis.
/// @param points      3 × m, at least one
/// @param directions  3 × k, unit vectors, at least one
Capsule capsule_around(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& directions);

/// A box that the arm must not touch, edges along the axes of the base frame.
struct BoxObstacle {
  std::string name;
  Eigen::Vector3d lower{Eigen::Vector3d::Zero()}, upper{Eigen::Vector3d::Zero()};  ///< corners [m]
};

/// Two capsules that are watched for collision, as indices.
struct CapsulePair {
  int first{0}, second{0};
  double clearance{0.0};  ///< that can be asked of them [m]
};

/// A capsule that is watched against an obstacle, as indices.
struct GuardedObstacle {
  int capsule{0}, obstacle{0};
};

/// Two links that are not, and why.
struct ExcludedPair {
  std::string first, second, reason;
};

/// An arm as capsules.
struct ArmCapsules {
  std::vector<Capsule> capsules;
  std::vector<CapsulePair> pairs;
  std::vector<GuardedObstacle> guarded;
  std::vector<ExcludedPair> excluded;
  std::vector<std::string> notes;  ///< links whose capsules are estimates
};

/// Capsules of the robot's links: around the collision shapes where there are any (a capsule is as long as its
/// cylinder, so it holds cylinder and rounded ends); else from one joint to the next with the radius of a uniform
/// cylinder of the link's smallest moment of inertia, kept between 1.5 and 6 % of the arm's length. `pairs`
/// and `guarded` are empty: choose_pairs.
ArmCapsules arm_capsules(const model::Robot& robot, const std::vector<model::LinkShape>& shapes = {});

/// Fills `pairs` with every two capsules of different links but neighbours in the chain. The clearance of a pair is the
/// one given, or half of the furthest apart that they are in 2000 random poses between the position limits and in the
/// middle, where that is less; pairs that are never further apart than a tenth of the clearance touch whatever the arm
/// does and are left out. Fills `guarded` with every obstacle for every capsule
/// that some joint moves to another place: a robot may be mounted on its table.
/// @param lower,upper  n, finite [rad, m]
void choose_pairs(const model::Robot& robot, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                  double clearance, const std::vector<BoxObstacle>& obstacles, ArmCapsules& arm);

/// The nearest points of two bodies, base frame.
struct Nearest {
  double distance{0.0};  ///< between surfaces [m]; negative by the depth where capsules overlap
  Eigen::Vector3d on_first{Eigen::Vector3d::Zero()},
      on_second{Eigen::Vector3d::Zero()};  ///< on axes, inside [m]
};

/// Distance of two capsules whose axes run from a to b, in the base frame [m].
Nearest distance(const Eigen::Vector3d& first_a, const Eigen::Vector3d& first_b, double first_radius,
                 const Eigen::Vector3d& second_a, const Eigen::Vector3d& second_b, double second_radius);
/// Distance of two capsules of an arm at one position.
Nearest distance(const LinkFrames& frames, const Capsule& first, const Capsule& second);
/// Distance of a capsule from a box; on_second is on the box. Where the axis enters the box: minus the radius.
Nearest distance(const LinkFrames& frames, const Capsule& capsule, const BoxObstacle& box);

/// Distances between the shapes themselves, through FCL.
class ShapeDistance {
 public:
  /// @param shapes     those that `arm` was made from
  /// @param arm        gives the pairs that are watched, and the capsule where a link has no shape
  /// @param obstacles  those that `arm.guarded` speaks of
  /// @throws ModelError when a mesh has no triangles
  ShapeDistance(const model::Robot& robot, const std::vector<model::LinkShape>& shapes,
                const ArmCapsules& arm, const std::vector<BoxObstacle>& obstacles = {});
  ~ShapeDistance();
  ShapeDistance(ShapeDistance&&) noexcept;
  ShapeDistance& operator=(ShapeDistance&&) noexcept;

  struct Result {
    double distance{0.0};  ///< [m]; 0 where shapes touch or overlap, infinite when nothing is watched
    std::string first, second;
  };
  /// The two bodies that are nearest to each other.
  /// @param q  n [rad, m]
  Result nearest(const Eigen::VectorXd& q) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::collision
