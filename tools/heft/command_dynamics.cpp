/// @file
/// heft dynamics: inverse dynamics, gravity torque or regressor for each row of a log.
#include <memory>
#include <string>

#include "command.hpp"
#include "console.hpp"
#include "heft/host/file.hpp"
#include "heft/report/dynamics.hpp"
#include "heft/validate/inverse_dynamics.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct DynamicsOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::string what{"torque"};
  std::string output;
};

validate::DynamicsQuantity quantity_of(const std::string& what) {
  if (what == "gravity") return validate::DynamicsQuantity::kGravity;
  if (what == "regressor") return validate::DynamicsQuantity::kRegressor;
  return validate::DynamicsQuantity::kTorque;
}

void run(const DynamicsOptions& options) {
  const Console console{options.output, options.result.json};
  const model::Robot robot = as_measured(load_robot_and_fit(options.robot), options.log.measured_at());
  data::LogFiles files = files_of(options.log, robot);
  files.judge.swap(files.train);
  files.torque = false;
  files.min_samples = 1;  // derivatives ask for more where they are needed
  const data::LogSet logs = open_logs(robot, files);
  validate::DynamicsOptions asked;
  asked.what = quantity_of(options.what);
  asked.band = options.log.band;
  validate::InverseDynamics dynamics;
  {
    Progress progress("computing");
    asked.progress = [&](const std::string& log, double done) { progress.update(done, log); };
    dynamics = validate::inverse_dynamics_along(robot, logs, asked);
  }
  for (const std::string& text : dynamics.notes) note(text);
  console.print("{}", report::full(dynamics));
  finish(console, options.output, options.result, report::json(dynamics), report::page(dynamics),
         [&] { host::write_file_atomically(options.output, report::csv(dynamics)); });
}

}  // namespace

Action set_up_dynamics(CommandLine line) {
  auto options = std::make_shared<DynamicsOptions>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  line.add_option("--what", options->what,
                  "torque (with rotor inertia and friction; rigid bodies only with --torque-at joint), "
                  "gravity or regressor")
      .type_name("WHAT")
      .one_of({"torque", "gravity", "regressor"})
      .capture_default_str();
  add_output_option(line, options->output, "result (CSV), one line a log row; - is standard output");
  add_result_options(line, options->result);
  line.footer(
      "The log needs q1..qN; qd and qdd are derived when missing. Columns of the result after `time` (with "
      "several logs a\n"
      "column `log` with their number, from 1, comes first):\n"
      "  torque     tau1..tauN\n"
      "  gravity    g1..gN\n"
      "  regressor  Y1_m1 ... : row 1 for all links (m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz, then "
      "the next link),\n"
      "             then Y1_rotor1..N, Y1_coulomb1..N, Y1_viscous1..N, Y1_offset1..N, then row 2...\n"
      "             With --torque-at joint the columns after the links are left out.\n"
      "When the log holds torque, --what torque also compares the two.\n"
      "Example: heft dynamics --urdf ur5e --log motion.csv -o torque.csv");
  return [options] { run(*options); };
}

}  // namespace heft::tools
