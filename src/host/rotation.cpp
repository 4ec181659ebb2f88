#include "heft/host/rotation.hpp"

#include <cmath>

namespace heft {

Eigen::Matrix3d rotation_from_z(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d d = direction / direction.norm();
  const double x = d.x(), y = d.y(), c = d.z();
  // 1 / (1 + c), which near c = -1 is known from x and y only.
  const double side = x * x + y * y;
  if (c < 0.0 && side == 0.0) return Eigen::Vector3d(1, -1, -1).asDiagonal();
  const double factor = c < 0.0 ? (1.0 - c) / side : 1.0 / (1.0 + c);
  // R = E + [v] + [v]² / (1 + c), v = z × d
  Eigen::Matrix3d R;
  R << 1.0 - factor * x * x, -factor * x * y, x,  //
      -factor * x * y, 1.0 - factor * y * y, y,   //
      -x, -y, c;
  return R;
}

}  // namespace heft
