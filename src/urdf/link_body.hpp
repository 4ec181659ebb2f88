// A link's ten parameters as `<inertial>` gives them.
#pragma once

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"

namespace heft::urdf {

/// A link as `<inertial>` has it, in link axes.
struct LinkBody {
  double mass{0.0};
  Eigen::Vector3d com{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d about_com{Eigen::Matrix3d::Zero()};
};

/// Centre of mass and inertia about it from first moment and inertia about the link's origin. Without mass the centre
/// is the origin.
LinkBody to_body(const InertialParameters<double>& p);

bool is_zero(const InertialParameters<double>& p);

}  // namespace heft::urdf
