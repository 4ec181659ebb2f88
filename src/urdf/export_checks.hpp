// What may be written into a URDF.
#pragma once

#include <string>
#include <vector>

#include "heft/model/robot.hpp"
#include "urdf_tree.hpp"

namespace heft::urdf {

/// The file's chain must be the robot's: parameters about other link frames mean something else.
/// @throws UrdfError
void check_same_chain(const model::Robot& file, const model::Robot& robot, const std::string& name);

/// Refuses values that cannot be written, and, unless allowed, impossible ones.
/// @param tree   of the file that `file` was read from
/// @param name   of the file, for messages
/// @param notes  one line for each impossible value that is written
/// @throws UrdfError naming link or joint
void check_values(const model::Robot& robot, const model::Robot& file, const UrdfTree& tree,
                  const std::string& name, bool allow_impossible, std::vector<std::string>& notes);

}  // namespace heft::urdf
