/// @file
/// How the base of an arm is mounted in a level world.
#pragma once

#include <array>

#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"

namespace heft::urdf {

/// Axes of the base in the world: turned about the world's x by `roll`, then about its y by `pitch`, then about its z
/// by `yaw` [rad]. Row-major, as UrdfOptions::mount_rotation: turns components in the base into components in the world.
std::array<double, 9> mount_rotation(double roll, double pitch, double yaw);

/// Gravity in the axes of a base that is mounted like this, Rᵀ (0, 0, −9.81) [m/s²].
/// @param rotation  orthonormal, see mount_rotation()
std::array<double, 3> gravity_in_base(const std::array<double, 9>& rotation);

/// Mounts the arm of a model file as `robot` is mounted: an orientation that is given holds, not the one that the model
/// was made with. A file that does not know its kinematics stays as it is.
void mount_like(const model::Robot& robot, model::ModelFile& file);

}  // namespace heft::urdf
