/// @file
/// Limits of motions and poses as the commands take them.
#pragma once

#include <string>
#include <vector>

#include "command_line.hpp"
#include "heft/excite/motion_limits.hpp"
#include "options.hpp"

namespace heft::tools {

/// --limits, --tool-speed, --full-turns, --no-floor.
struct SafetyOptions {
  std::string limits;
  double tool_speed{excite::kToolSpeed};
  bool full_turns{false};
  bool no_floor{false};
};
void add_safety_options(CommandLine line, SafetyOptions& options);
/// The same without --tool-speed, for poses.
void add_pose_options(CommandLine line, SafetyOptions& options);

/// Limits of the robot, with its URDF's collision shapes where there is one, and those of the limits file in their
/// place. Notes go to standard error.
excite::LimitsFile load_limits(const RobotOptions& robot_options, const model::Robot& robot,
                               const SafetyOptions& options, bool speed_given);

}  // namespace heft::tools
