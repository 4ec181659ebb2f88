#include "parsers.hpp"

#include <algorithm>
#include <array>

#include "heft/data/deflections.hpp"
#include "heft/data/describe_log.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/read_map.hpp"
#include "heft/drive/torque_constants.hpp"
#include "heft/excite/motion_limits.hpp"
#include "heft/excite/separate.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/payload/payload.hpp"
#include "heft/sim/scenario.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_export.hpp"
#include "heft/urdf/urdf_import.hpp"

#include "input_file.hpp"

namespace heft::fuzz {
namespace {

/// An arm of two joints, which settings for n joints are read for.
const model::Robot& two_joints() {
  static const model::Robot robot = urdf::load_urdf(HEFT_SOURCE_DIR "/test/fuzz/seeds/urdf/two_joints.urdf");
  return robot;
}

/// The torque constants that `--torque-constant` would give, so that currents are read too.
data::LogRequirements everything() {
  data::LogRequirements needs;
  needs.torque = true;
  needs.torque_constant = {1.0};
  return needs;
}

void read_text_log(const std::string& path) { data::read_log(path, everything()); }

void read_arriving_log(const std::string& path) {
  data::LiveLog log(path, everything(), [](const std::string&) {});
  data::LiveRow row;
  while (log.next(row)) {
  }
}

/// What is read can be written, and read again.
void read_model(const std::string& path) {
  const model::ModelFile file = model::read_model(path);
  model::parse_model(model::to_json(file), path);
  monitor::thresholds_of(file);
  const model::Robot robot = file.kinematics ? model::make_robot(file) : two_joints();
  payload::arm_from_file(robot, file, {}, 0, {});
}

void read_scenario(const std::string& path) {
  const sim::Scenario scenario = sim::parse_scenario(host::read_file(path, "scenario"), path,
                                                     [](const std::string&) { return two_joints(); });
  if (scenario.controller.kind != "track") sim::make_controller(scenario);
}

void read_urdf(const std::string& path) {
  const model::Robot robot = urdf::load_urdf(path);
  urdf::load_shapes(path, robot);
}

/// A robot's parameters are put into the text by a parser of its own. A second text is the same, or the robot is refused.
void write_urdf(const std::string& path) {
  urdf::UrdfOptions as_it_is;
  as_it_is.accept_impossible_values = true;
  const std::string text = host::read_file(path, "URDF");
  model::Robot robot = urdf::load_urdf_string(text, path, as_it_is);
  for (model::RobotJoint& joint : robot.joints) {
    for (double& value : joint.link) value *= 2.0;
  }
  std::string once;
  try {
    once = urdf::urdf_with_parameters(text, path, robot);
  } catch (const InputError&) {
    throw;
  } catch (const Error& error) {  // numbers of any size: the text was read again, compared, and not written
    if (std::string_view(error.what()).find("parameters so far from any body") == std::string_view::npos)
      throw;
    return;
  }
  if (urdf::urdf_with_parameters(once, path, robot) != once) give_up("urdf_write: written twice differs");
}

/// As the mesh of a URDF. What is no mesh is told, not refused.
void read_mesh(const std::string& path) {
  urdf::load_shapes_string(
      "<robot name=\"one\"><link name=\"base\"/><link name=\"tip\"><collision><geometry><mesh filename=\"" +
          path +
          "\"/></geometry></collision></link><joint name=\"turn\" type=\"revolute\"><parent link=\"base\"/><child "
          "link=\"tip\"/></joint></robot>",
      path, two_joints());
}

void read_limits(const std::string& path) {
  excite::read_limits(two_joints(), path, excite::limits_of(two_joints()));
}
void read_deflections(const std::string& path) { data::read_deflections(path, 2, "two_joints"); }
void describe_log(const std::string& path) { data::describe_logs({path}); }
void read_map(const std::string& path) { data::read_map({path}); }
void read_torque_constants(const std::string& path) { drive::read_torque_constants(path); }
void read_diagnosis(const std::string& path) { excite::read_questions(two_joints(), path); }

constexpr std::array<Parser, 13> kParsers{{
    {"text", "data/foreign", read_text_log},
    {"live", "data/foreign", read_arriving_log},
    {"describe", "data/foreign", describe_log},
    {"map", "fuzz/seeds/map", read_map},
    {"deflections", "fuzz/seeds/deflections", read_deflections},
    {"torque_constants", "fuzz/seeds/torque_constants", read_torque_constants},
    {"model", "fuzz/seeds/model", read_model},
    {"diagnosis", "fuzz/seeds/diagnosis", read_diagnosis},
    {"limits", "fuzz/seeds/limits", read_limits},
    {"scenario", "fuzz/seeds/scenario", read_scenario},
    {"urdf", "fuzz/seeds/urdf", read_urdf},
    {"urdf_write", "fuzz/seeds/urdf", write_urdf},
    {"mesh", "fuzz/seeds/mesh", read_mesh},
}};

/// One line that says where: it begins with the file's name.
void check_message(const std::string& path, const std::string& message) {
  const bool one_line = std::none_of(message.begin(), message.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
  if (!one_line) give_up("the message has several lines, or control characters: " + message);
  if (message.rfind(path + ":", 0) != 0) give_up("the message does not name the file: " + message);
}

}  // namespace

std::span<const Parser> parsers() { return kParsers; }

std::string try_to_read(const Parser& parser, std::string_view text) {
  const InputFile file(text, ".json");
  std::string message;
  try {
    parser.read(file.path());
  } catch (const InputError& error) {
    message = error.what();
  } catch (const NotIdentifiableError& error) {
    message = error.what();
  }
  if (!message.empty()) check_message(file.path(), message);
  return message;
}

}  // namespace heft::fuzz
