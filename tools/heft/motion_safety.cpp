#include "motion_safety.hpp"

#include "console.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::tools {

void add_pose_options(CommandLine line, SafetyOptions& options) {
  line.add_option("--limits", options.limits,
                  "limits that replace those of the URDF, and obstacles (heft excite --help has its keys)")
      .type_name("LIMITS.json")
      .names_file(FileUse::kInput);
  line.add_flag("--full-turns", options.full_turns,
                "use ranges beyond ±180° where a joint has them (mind hoses and cables)");
  line.add_flag("--no-floor", options.no_floor, "no floor");
}

void add_safety_options(CommandLine line, SafetyOptions& options) {
  add_pose_options(line, options);
  line.add_option(
          "--tool-speed", options.tool_speed,
          "speed limit of the tool and of every link origin [m/s]; the default is that of Universal Robots' "
          "controllers as delivered; ISO 10218-1 allows 0.25 with people near the arm")
      .type_name("M/S")
      .positive()
      .capture_default_str();
}

excite::LimitsFile load_limits(const RobotOptions& robot_options, const model::Robot& robot,
                               const SafetyOptions& options, bool speed_given) {
  excite::LimitDefaults defaults;
  defaults.full_turns = options.full_turns;
  defaults.tool_speed = options.tool_speed;
  if (!robot_options.urdf.empty()) {
    std::vector<std::string> notes;
    defaults.shapes = urdf::load_shapes(urdf::resolve_robot(robot_options.urdf), robot, &notes);
    for (const std::string& text : notes) note(text);
  }
  excite::LimitsFile file{excite::limits_of(robot, defaults), {}, {}};
  for (const std::string& text : file.limits.arm.notes) note(text);
  if (!options.limits.empty()) file = excite::read_limits(robot, options.limits, std::move(file.limits));
  // The command line takes precedence over the file.
  if (speed_given) file.limits.tool_speed = options.tool_speed;
  if (options.no_floor) file.limits.floor.reset();
  return file;
}

}  // namespace heft::tools
