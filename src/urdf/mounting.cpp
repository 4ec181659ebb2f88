#include "heft/urdf/mounting.hpp"

#include <cmath>
#include <cstddef>

#include "heft/urdf/urdf_import.hpp"

namespace heft::urdf {

std::array<double, 9> mount_rotation(double roll, double pitch, double yaw) {
  const double cr = std::cos(roll), sr = std::sin(roll);
  const double cp = std::cos(pitch), sp = std::sin(pitch);
  const double cy = std::cos(yaw), sy = std::sin(yaw);
  return {cy * cp,
          cy * sp * sr - sy * cr,
          cy * sp * cr + sy * sr,  //
          sy * cp,
          sy * sp * sr + cy * cr,
          sy * sp * cr - cy * sr,  //
          -sp,
          cp * sr,
          cp * cr};
}

std::array<double, 3> gravity_in_base(const std::array<double, 9>& rotation) {
  const std::array<double, 3> down = UrdfOptions{}.gravity;
  std::array<double, 3> gravity{};
  for (std::size_t i = 0; i < 3; ++i)
    gravity[i] = rotation[i] * down[0] + rotation[3 + i] * down[1] + rotation[6 + i] * down[2];
  return gravity;
}

void mount_like(const model::Robot& robot, model::ModelFile& file) {
  if (file.kinematics) file.kinematics->gravity = robot.gravity;
}

}  // namespace heft::urdf
