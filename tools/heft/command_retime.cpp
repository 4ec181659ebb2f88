/// @file
/// heft retime: the fastest motion along a path that waypoints or a log give.
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "heft/report/retime.hpp"
#include "heft/retime/retime.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct RetimeOptions {
  RobotOptions robot;
  ReadOptions read;
  std::string log, waypoints, output;
  std::vector<double> payload;
  double rounding{0.0};
  bool no_rehearsal{false};
  retime::Options retime;
  ResultOptions result;
};

retime::Path path_of(const RetimeOptions& options, const model::Robot& robot) {
  if (!options.waypoints.empty()) {
    data::LogRequirements needs;
    needs.num_joints = robot.num_joints();
    needs.robot_name = robot.name;
    needs.as = read_as(options.read, robot);
    return retime::through(robot, data::read_log(options.waypoints, needs), options.rounding);
  }
  LogOptions log;
  log.logs = {options.log};
  log.read = options.read;
  data::LogFiles files = files_of(log, robot);
  files.judge.swap(files.train);
  files.torque = false;
  return retime::along(robot, open_logs(robot, files).judge().front());
}

void run(const RetimeOptions& options) {
  const Console console{options.output, options.result.json};
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  retime::Options asked = options.retime;
  asked.load = payload_of(options.payload);
  asked.rehearse = !options.no_rehearsal;
  asked.behind_gears = loaded.fit && loaded.fit->torque_at == "joint";
  const retime::Retiming found = retime::retime(loaded.robot, path_of(options, loaded.robot), asked);
  console.print("{}", report::full(found));
  // A motion that exceeds a limit is not written.
  const std::string output = found.usable() ? options.output : "";
  finish(console, output, options.result, report::json(found), report::page(found),
         [&] { data::write_log(output, found.log); });
  if (!found.usable()) {
    throw NotIdentifiableError(
        fmt::format("{}: no motion along this path: {}{}", found.path.source.empty() ? "waypoints" : found.path.source, found.judgement.reasons.front(),
                    options.output.empty() ? "" : "; " + options.output + " was not written"));
  }
}

void add_limit_options(CommandLine line, RetimeOptions& options) {
  const auto add = [&](const char* name, std::vector<double>& values, const char* meaning) {
    line.add_option(name, values, meaning).type_name("L,L,...").delimiter(',').positive();
  };
  add("--torque", options.retime.torque,
      "torque limits, one for all joints or one a joint [N·m, N] (default: effort limits of the URDF)");
  add("--velocity", options.retime.velocity,
      "velocity limits, one for all joints or one a joint [rad/s, m/s] (default: those of the URDF)");
  add("--acceleration", options.retime.acceleration,
      "acceleration limits, one for all joints or one a joint [rad/s², m/s²] (default: none)");
  line.add_option("--margin", options.retime.margin_percent,
                  "part of every limit that the plan leaves to the controller and to errors of the model [%]")
      .type_name("PERCENT")
      .from_to_below(0.0, 100.0)
      .capture_default_str();
  line.add_option("--speed", options.retime.speed, "share of the velocity limits that is used, 0.01 to 1")
      .type_name("SHARE")
      .between(0.01, 1.0)
      .capture_default_str();
}

}  // namespace

Action set_up_retime(CommandLine line) {
  auto options = std::make_shared<RetimeOptions>();
  add_robot_options(line, options->robot);
  line.add_option("--log", options->log, "log whose path is taken, without its time")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements);
  line.add_option("--waypoints", options->waypoints,
                  "points that the path goes through, as a log: a row a point; `time` only numbers them")
      .type_name("POINTS.csv")
      .names_file(FileUse::kInput);
  add_read_options(line, options->read);
  line.add_option(
          "--rounding", options->rounding,
          "straight lines between the points of --waypoints, corners cut from so far before a point to so far behind "
          "it [rad, m] (default: a smooth curve through the points)")
      .type_name("R")
      .positive();
  add_payload_option(line, options->payload);
  add_limit_options(line, *options);
  line.add_option("--rate", options->retime.rate, "rows a second of the output [Hz]")
      .type_name("HZ")
      .positive()
      .capture_default_str();
  line.add_flag("--no-rehearsal", options->no_rehearsal,
                "leave out the run on the simulated arm (the verdict is then doubtful)");
  add_output_option(line, options->output,
                    "motion (CSV): time, q*, tau* (predicted torque), qd*, qdd*; - is standard output",
                    false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    if (options->log.empty() == options->waypoints.empty())
      throw UsageError("give either --log LOG.csv or --waypoints POINTS.csv: the path to take");
    if (options->rounding > 0.0 && options->waypoints.empty())
      throw UsageError("--rounding is for --waypoints only; leave it out");
  });
  line.footer(
      "The path is kept and its time is chosen anew, from rest to rest: at every place as fast as torque (with friction,\n"
      "effects and payload of the model), velocity and acceleration limits allow. The result is checked between the places of\n"
      "the path and run on the simulated arm; where a joint's controller needs more than the margin, more is left.\n"
      "Where no motion keeps the limits, exit code 4 and the joint and place that stop it. Obstacles are not looked at.\n"
      "Example: heft retime --urdf ur10e --model arm.json --log taught.csv --report fast.html -o fast.csv\n"
      "Example: heft retime --urdf ur5e --waypoints points.csv --payload 3,0,0,0.1 --speed 0.8 -o fast.csv");
  return [options] { run(*options); };
}

}  // namespace heft::tools
