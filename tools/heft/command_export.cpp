/// @file
/// heft export: a robot and a model as a constexpr C++ header for firmware, as a model file of a simulator, or its friction
/// for its controller.
#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "arm_header.hpp"
#include "command.hpp"
#include "console.hpp"
#include "heft/exchange/friction_scales.hpp"
#include "heft/exchange/robot_formats.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/report/exchange.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct ExportOptions {
  RobotOptions robot;
  std::string type_name;
  std::string name_space;
  std::string format{"cpp"};
  std::string controller;
  std::string output;
};

/// For another program than heft.
void write_text(const ExportOptions& options, const Console& console, const model::Robot& robot,
                const exchange::RobotFormat& format, const exchange::RobotText& written) {
  host::write_file_atomically(options.output, written.text);
  console.print("{} with {} joints as {}\n{}", robot.name, robot.num_joints(), format.title,
                report::full(written, format, robot));
  if (!host::is_standard_output(options.output)) console.print("Written: {}\n", options.output);
}

/// For a simulator.
void write_robot(const ExportOptions& options, const Console& console, const model::Robot& robot) {
  const auto formats = exchange::robot_formats();
  const auto format = std::find_if(formats.begin(), formats.end(),
                                   [&](const exchange::RobotFormat& f) { return f.id == options.format; });
  write_text(options, console, robot, *format, exchange::to_text(robot, options.format));
}

/// For the controller that the robot has.
void write_scales(const ExportOptions& options, const Console& console, const model::Robot& robot) {
  RobotOptions of_controller = options.robot;
  of_controller.model = options.controller;
  write_text(options, console, robot, exchange::friction_scales_format(),
             exchange::ur_friction_scales(robot, load_robot(of_controller)));
}

void run(const ExportOptions& options) {
  const Console console{options.output};
  const model::Robot robot = load_robot(options.robot);
  if (options.format == exchange::friction_scales_format().id) return write_scales(options, console, robot);
  if (options.format != "cpp") return write_robot(options, console, robot);
  ArmHeaderNames names;
  names.type = options.type_name.empty() ? type_name_of(robot.name) : options.type_name;
  names.name_space = options.name_space;
  names.source_of_truth = options.robot.urdf;
  if (!options.robot.model.empty()) {
    names.source_of_truth += (options.robot.urdf.empty() ? "" : " and ") + options.robot.model;
  }
  std::optional<monitor::Thresholds> thresholds;
  if (!options.robot.model.empty())
    thresholds = monitor::thresholds_of(model::read_model(options.robot.model));
  const std::string header = arm_header(robot, names, thresholds ? &*thresholds : nullptr);
  console.print("{} with {} joints as struct {}\n", robot.name, robot.num_joints(),
                names.name_space.empty() ? names.type : names.name_space + "::" + names.type);
  host::write_file_atomically(options.output, header);
  if (!host::is_standard_output(options.output)) console.print("Written: {}\n", options.output);
}

}  // namespace

Action set_up_export(CommandLine line) {
  auto options = std::make_shared<ExportOptions>();
  add_robot_options(line, options->robot);
  line.add_option(
          "--format", options->format,
          "cpp: a header for firmware; urdf, mjcf, sdf: a model of the dynamics for a simulator, without shapes; "
          "ur-friction: its friction in parts of what a Universal Robots controller compensates for")
      .type_name("FORMAT")
      .one_of({"cpp", "urdf", "mjcf", "sdf", "ur-friction"})
      .capture_default_str();
  line.add_option("--name", options->type_name, "name of the struct (default: made from the robot's name)")
      .type_name("TYPE");
  line.add_option("--namespace", options->name_space,
                  "namespace of the struct, such as app::arms (default: none)")
      .type_name("NAME");
  line.add_option("--controller", options->controller,
                  "with ur-friction: model file with the friction that the controller adds at scale 1, such as one "
                  "fitted to its target current")
      .type_name("MODEL.json")
      .names_file(FileUse::kInput);
  add_output_option(line, options->output, "the header or model file; - is standard output");
  line.parse_complete_callback([options] {
    if (options->format != "cpp" && !(options->type_name + options->name_space).empty())
      throw UsageError("--name and --namespace are those of a C++ header; expected --format cpp with them");
    if ((options->format == exchange::friction_scales_format().id) == options->controller.empty()) {
      throw UsageError(options->controller.empty()
                           ? "--format ur-friction says friction in parts of the controller's; expected --controller "
                             "MODEL.json, a model fitted to the controller's own torque"
                           : "--controller is the friction that scales are parts of; expected --format ur-friction with it");
    }
  });
  line.footer(
      "The header needs heft's core alone. Its struct is a description for the compile-time dynamics:\n"
      "a member kModel of type heft::ArmModel<double, N>, and also kCouplings, kEffects (for\n"
      "heft::EffectFeedForward), kElasticities and kTorqueDelay with what a model holds beyond rigid bodies "
      "and\n"
      "friction; and kThresholds (for heft::ContactMonitor) where heft monitor --learn has written them.\n"
      "What a simulator's form cannot express is listed with its share of the torque. To put identified values into a\n"
      "URDF of your own, layout kept, use heft identify --write-urdf.\n"
      "Example: heft export --urdf ur5e --model fitted.json --namespace app -o ur5e.hpp\n"
      "         heft export --model fitted.json --format mjcf -o ur5e.xml\n"
      "         heft export --model fitted.json --format ur-friction --controller own.json -o ur5e.script");
  return [options] { run(*options); };
}

}  // namespace heft::tools
