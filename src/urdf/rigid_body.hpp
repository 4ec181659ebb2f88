// Placements and bodies as URDF gives them: what reading and writing back share.
#pragma once

#include <string>

#include <urdf_model/link.h>
#include <urdf_model/pose.h>
#include <Eigen/Core>

#include "heft/core/arm_model.hpp"

namespace heft::urdf {

/// Placement of frame B in frame A: components in A are R times components in B plus p.
struct Placement {
  Eigen::Matrix3d R{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d p{Eigen::Vector3d::Zero()};
};

Placement operator*(const Placement& a, const Placement& b);

/// Exactly 0, 1 or -1 where the value is that near to one of them.
double snapped(double value, double tolerance);
/// See load_urdf on why entries near 0 and ±1 are made exact.
Eigen::Matrix3d snapped(const Eigen::Matrix3d& rotation);
/// A picometre is rounding from merged fixed joints, never a dimension.
Eigen::Vector3d snapped(const Eigen::Vector3d& position);

Placement placement_of(const ::urdf::Pose& pose);

/// Inertia tensor about the centre of mass, axes of the inertial frame.
Eigen::Matrix3d inertia_of(const ::urdf::Inertial& inertial);

/// Mass, first moment and inertia about the origin of a link frame, of one body or several together.
struct Body {
  double mass{0.0};
  Eigen::Vector3d first_moment{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d inertia{Eigen::Matrix3d::Zero()};

  /// Adds a body given by mass, centre of mass and inertia about the centre of mass, all in this frame.
  void add(double m, const Eigen::Vector3d& c, const Eigen::Matrix3d& about_com);

  InertialParameters<double> parameters() const;
};

/// Why this inertia about the centre of mass is physically impossible; empty when it is possible.
std::string impossibility(const Eigen::Matrix3d& inertia);

}  // namespace heft::urdf
