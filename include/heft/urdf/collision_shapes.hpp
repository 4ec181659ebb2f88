/// @file
/// Collision geometry of a robot from its URDF file.
#pragma once

#include <string>
#include <vector>

#include "heft/model/link_shape.hpp"
#include "heft/model/robot.hpp"

namespace heft::urdf {

/// The `<collision>` shapes of the robot's links and of everything fixed to them: box, cylinder, sphere, capsule
/// (taken as cylinder and two spheres) and meshes in STL files, which are looked for relative to the URDF and, for
/// `package://NAME/...`, in the folders above it. What hangs from a link by a joint off the chain, such as the
/// fingers of a gripper, is taken with that joint at zero.
///
/// @param path      file that `robot` was loaded from
/// @param warnings  one line for each shape that could not be read (the link's capsule is then fitted from the
///                  kinematics), may be null
/// @throws UrdfError naming file and line when the file or the numbers of a shape cannot be used.
std::vector<model::LinkShape> load_shapes(const std::string& path, const model::Robot& robot,
                                          std::vector<std::string>* warnings = nullptr);

/// The same from text; meshes are looked for relative to the working directory.
/// @param name  of the file, for messages
std::vector<model::LinkShape> load_shapes_string(const std::string& text, const std::string& name,
                                                 const model::Robot& robot,
                                                 std::vector<std::string>* warnings = nullptr);

}  // namespace heft::urdf
