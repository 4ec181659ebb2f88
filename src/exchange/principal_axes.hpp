/// @file
/// Principal moments of inertia and their axes.
#pragma once

#include <Eigen/Core>

namespace heft::exchange {

struct PrincipalAxes {
  Eigen::Vector3d moments;  ///< [kg·m²]
  Eigen::Matrix3d
      rotation;  ///< columns are the axes, right-handed; of all choices the one nearest to no turn
};

/// inertia = rotation diag(moments) rotationᵀ.
PrincipalAxes principal_axes(const Eigen::Matrix3d& inertia);

}  // namespace heft::exchange
