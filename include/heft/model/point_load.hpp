/// @file
/// A load at the flange that is a point.
#pragma once

#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::model {

/// A load on the flange.
struct PointLoad {
  double mass{0.0};                              ///< [kg], ≥ 0
  Eigen::Vector3d com{Eigen::Vector3d::Zero()};  ///< in the tip frame [m]
};

/// A point mass as parameters of the link in whose frame its place is.
/// @param com  [m]
InertialParameters<double> point_body(double mass, const Eigen::Vector3d& com);

/// The robot with a load that is a point mass fixed to its tip.
/// @throws ModelError for a mass that is negative or not finite
Robot with_load(Robot robot, const PointLoad& load);

}  // namespace heft::model
