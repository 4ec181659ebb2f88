/// @file
/// heft log: what a log holds and how it is understood; any log as heft's CSV.
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/describe_log.hpp"
#include "heft/host/file.hpp"
#include "heft/report/log_description.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct LogCommandOptions {
  RobotOptions robot;
  LogOptions log;
  std::string output, json;
};

/// A robot names its joints, and has masses that the torque is compared with.
void compare_with_robot(const LogCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  const data::LogSet logs = open_logs(robot, files_of(options.log, robot));
  judge_torque(logs, robot, options.log);
}

void run(const LogCommandOptions& options) {
  const Console console{options.output, options.json};
  const bool with_robot = !options.robot.urdf.empty() || !options.robot.model.empty();
  const data::ReadAs as =
      with_robot ? read_as(options.log.read, load_robot(options.robot)) : read_as(options.log.read);
  if (!options.output.empty()) {
    const data::LogConversion conversion = data::convert_logs(options.log.logs, as, options.output);
    for (const std::string& text : conversion.notes) note(text);
    console.print("{}\n", report::brief(conversion));
    if (!host::is_standard_output(options.output)) console.print("Written: {}\n", options.output);
    return;
  }
  const std::vector<data::LogDescription> logs = data::describe_logs(options.log.logs, as);
  for (const data::LogDescription& log : logs) console.print("{}", report::full(log));
  write_json(options.json, report::json(logs));
  if (with_robot) compare_with_robot(options);
}

}  // namespace

Action set_up_log(CommandLine line) {
  auto options = std::make_shared<LogCommandOptions>();
  line.add_option("logs", options->log.logs,
                  "logs of any format that heft reads; with -o one a signal is joined by time")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements)
      .required();
  add_read_options(line, options->log.read);
  add_output_option(line, options->output, "all of it as heft's CSV; - is standard output", false);
  line.add_option("--json", options->json, "write the description as JSON; - is standard output")
      .type_name("FILE")
      .names_file(FileUse::kOutput);
  add_robot_options(line, options->robot);
  line.get_option("--urdf").description(
      "robot that made the logs: its joints' names order columns that name theirs, and the torque is compared with it");
  line.parse_complete_callback([options] {
    if (!options->output.empty() && !options->json.empty())
      throw UsageError("--json does not go with -o: either the log is described or it is converted");
  });
  line.footer(
      "Formats are recognised by content: CSV and other text (commas, semicolons, tabs, blanks; decimal commas; gzip; units in\n"
      "the header or below it), recordings of UR RTDE, libfranka, rostopic, PlotJuggler; ROS 2 bags (MCAP, SQLite, folders);\n"
      "MATLAB; NumPy.\n"
      "Example: heft log robot_data.csv\n"
      "Example: heft log q.csv tau.csv --map time=500Hz -o run.csv");
  return [options] { run(*options); };
}

}  // namespace heft::tools
