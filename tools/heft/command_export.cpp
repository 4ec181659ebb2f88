/// @file
/// heft export: a robot and a model as a constexpr C++ header for firmware.
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "arm_header.hpp"
#include "command.hpp"
#include "console.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct ExportOptions {
  RobotOptions robot;
  std::string type_name;
  std::string name_space;
  std::string output;
};

void run(const ExportOptions& options) {
  const Console console{options.output};
  const model::Robot robot = load_robot(options.robot);
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
  line.add_option("--name", options->type_name, "name of the struct (default: made from the robot's name)")
      .type_name("TYPE");
  line.add_option("--namespace", options->name_space,
                  "namespace of the struct, such as app::arms (default: none)")
      .type_name("NAME");
  add_output_option(line, options->output, "the header (.hpp); - is standard output");
  line.footer(
      "The header needs heft's core alone. Its struct is a description for the compile-time dynamics:\n"
      "a member kModel of type heft::ArmModel<double, N>, and also kCouplings, kEffects (for\n"
      "heft::EffectFeedForward), kElasticities and kTorqueDelay with what a model holds beyond rigid bodies "
      "and\n"
      "friction; and kThresholds (for heft::ContactMonitor) where heft monitor --learn has written them.\n"
      "Example: heft export --urdf ur5e --model fitted.json --namespace app -o ur5e.hpp");
  return [options] { run(*options); };
}

}  // namespace heft::tools
