/// @file
/// Robots from URDF files.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "heft/model/robot.hpp"

namespace heft::urdf {

/// Which chain of the file to take, and how the robot is mounted.
struct UrdfOptions {
  std::string base_link;  ///< first link of the chain, held still; empty: the root of the tree
  std::string tip_link;   ///< last link of the chain; empty: the end of the only chain
  /// Acceleration of gravity in the world frame, which is level [m/s²].
  std::array<double, 3> gravity{0.0, 0.0, -9.81};
  /// How the base is mounted: axes of the base-link frame in the world frame, row-major (R_WB turns components
  /// in the base frame into components in the world frame). The robot's gravity is R_WBᵀ times the above.
  std::array<double, 9> mount_rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  /// Refuse physically impossible link inertias. Several published robots have them: the default is to warn.
  bool refuse_impossible_inertia{false};
  /// Take masses not above zero and negative friction as given, instead of refusing them. For files that
  /// hold the unconstrained result of a fit (urdf_export.hpp).
  bool accept_impossible_values{false};
};

/// Reads the chain between two links as a robot.
///
/// - Joints: revolute, continuous and prismatic, about (along) any axis. Fixed joints are merged: the bodies
///   behind them, on side branches too, count as part of the moving link. What hangs off the base is left out.
/// - Link frames are the URDF's. Inertial parameters are turned into the ten of heft::InertialParameters, about
///   the link-frame origin in link axes.
/// - `<limit>` gives position, velocity and effort limits; a velocity or effort of 0 means "not stated" and
///   leaves infinity. `<dynamics friction damping>` gives the Coulomb and the viscous coefficient.
/// - Rotation entries within 1e-12 of 0 or ±1 become exactly that. Entries within 1e-8 do too, as long as the
///   matrix stays a rotation to 1e-14: files that print a quarter turn as 1.57079633 are off by 3e-9 rad, which
///   nobody means, and which would keep the compile-time dynamics from dropping the products by zero.
/// - A moving link without mass is accepted when another one moves further out, and warned about.
///
/// @param warnings  one line for each thing worth knowing (impossible inertia, parts left out), may be null
/// @throws UrdfError naming file and, where known, line: what was found, what was expected, what to do.
model::Robot load_urdf(const std::string& path, const UrdfOptions& options = {},
                       std::vector<std::string>* warnings = nullptr);

/// The same from text.
/// @param name  of the file, for messages
model::Robot load_urdf_string(const std::string& text, const std::string& name,
                              const UrdfOptions& options = {}, std::vector<std::string>* warnings = nullptr);

/// File of a robot given by path or by name.
///
/// A path to an existing file is returned as it is. A bare name (`ur5e`) is looked for as NAME and NAME.urdf in
/// the folders of the environment variable HEFT_URDF_PATH (separated by colons), then in the robots that come
/// with heft.
/// @throws UrdfError that lists the folders searched and the robots known.
std::string resolve_robot(const std::string& name_or_path);

/// Names of the robots that resolve_robot finds, in alphabetical order.
std::vector<std::string> robot_names();

/// Path of measurements that come with heft, kept with its robots ("ur5-stiffness/tool.csv").
/// @throws DataError naming the folders that were searched.
std::string resolve_measurements(const std::string& name);

}  // namespace heft::urdf
