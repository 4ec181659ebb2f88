/// @file
/// heft torque-constants: the torque an ampere gives, from the drive's own signals or from a known load.
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/drive/torque_constants.hpp"
#include "heft/host/error.hpp"
#include "heft/report/torque_constants.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct TorqueConstantsOptions {
  RobotOptions robot;
  std::vector<std::string> logs;
  ReadOptions read;
  std::vector<double> assumed;
  double load_mass{0.0};
  std::vector<double> load_com;
  ResultOptions result;
};

drive::TorqueConstants constants_of(const TorqueConstantsOptions& options) {
  if (!(options.load_mass > 0.0)) {
    const data::LogSet logs = drive::open_logs(options.logs, read_as(options.read));
    for (const std::string& text : logs.notes()) note(text);
    return drive::from_targets(logs);
  }
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  LogOptions log;
  log.torque_constant = options.assumed;
  log.read = options.read;
  data::LogFiles files = files_of(log, loaded.robot, options.logs);
  const data::LogSet logs = open_logs(loaded.robot, files);
  drive::KnownLoad load{options.load_mass, {}};
  if (!options.load_com.empty()) load.com = {options.load_com[0], options.load_com[1], options.load_com[2]};
  return drive::from_known_load(loaded.robot, logs, load, options.assumed, loaded.fitted_to);
}

void run(const TorqueConstantsOptions& options) {
  const Console console{options.result.json};
  const drive::TorqueConstants constants = constants_of(options);
  console.print("{}", report::full(constants));
  finish(console, "", options.result, report::json(constants), report::page(constants));
  if (!constants.usable()) throw NotIdentifiableError(report::brief(constants));
}

}  // namespace

Action set_up_torque_constants(CommandLine line) {
  auto options = std::make_shared<TorqueConstantsOptions>();
  line.add_option(
          "--log", options->logs,
          "log with the controller's target torque (tauref1..) and its target current (iref1..) or the measured "
          "current (i1..); with --load-mass a log of the arm with that load; may be given several times")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements)
      .required();
  add_read_options(line, options->read);
  add_robot_options(line, options->robot);
  line.add_option(
          "--load-mass", options->load_mass,
          "[kg] of a known load: constants from its torque; needs --model, fitted to logs without load")
      .type_name("KG")
      .positive();
  line.add_option(
          "--load-com", options->load_com,
          "[m] centre of mass of the known load in the frame of the tip (default: found with the constants)")
      .type_name("X,Y,Z")
      .delimiter(',')
      .expected(3);
  line.add_option(
          "--torque-constant", options->assumed,
          "[N·m/A] constants that made the torque of the model and of the logs, one value or one a joint")
      .type_name("K,K,...")
      .delimiter(',');
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    const bool load = options->load_mass > 0.0;
    if (load && options->robot.model.empty())
      throw UsageError(
          "--load-mass needs --model MODEL.json: the arm without load, fitted with the constants of --torque-constant");
    if (load && options->assumed.empty())
      throw UsageError(
          "--load-mass needs --torque-constant: the constants that made the torque of the model and of the logs");
    if (!load && (!options->load_com.empty() || !options->assumed.empty() || !options->robot.model.empty() ||
                  !options->robot.urdf.empty())) {
      throw UsageError(
          "--urdf, --model, --load-com and --torque-constant belong to --load-mass; without a known load the constants come "
          "from the log alone");
    }
  });
  line.footer(
      "At standstill the target current holds no friction: there the constant is target torque over target current.\n"
      "Where no standstill loads a joint, or only the measured current is known, current and target torque are compared\n"
      "while the joint moves, and friction is estimated with the constant.\n"
      "Example: heft torque-constants --log run-1.csv --log run-2.csv --json constants.json");
  return [options] { run(*options); };
}

}  // namespace heft::tools
