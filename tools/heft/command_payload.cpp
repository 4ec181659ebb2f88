/// @file
/// heft payload: the load at the flange, estimated sample by sample over a log or a stream.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/exchange/load_formats.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/exchange.hpp"
#include "heft/report/payload.hpp"
#include "live_stream.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct PayloadCommandOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::string stream;
  std::vector<std::string> baselines;
  std::vector<std::string> zeros;
  std::string output;
  std::string format;
  std::string load_file;
  double transition_time{0.0};
  int rows{1};
  double true_mass{0.0};
};

/// The logs without load to fit to, then those that check the model and those with the load.
data::LogSet open(const PayloadCommandOptions& options, const model::Robot& robot) {
  std::vector<std::string> judge = options.zeros;
  judge.insert(judge.end(), options.log.logs.begin(), options.log.logs.end());
  data::LogFiles files = files_of(options.log, robot, judge);
  files.train = options.baselines;
  files.split = 0.0;
  return open_logs(robot, files);
}

/// The steps of an estimate, one after the other.
class Steps {
 public:
  void update(const std::string& what, double done) {
    if (what != what_) progress_.emplace(what);
    what_ = what;
    progress_->update(done);
  }

 private:
  std::string what_;
  std::optional<Progress> progress_;
};

/// How to estimate, with what is known against the torque of the logs.
payload::Options settings(const PayloadCommandOptions& options, const model::Robot& robot,
                          const data::LogSet& logs) {
  payload::Options how;
  how.first_joint = options.rows;
  how.cutoff = options.log.band;
  how.torque_at = logs.torque_at();
  how.true_mass = options.true_mass;
  for (const data::LogSource& log : logs.given())
    how.torque.push_back(judge_torque(data::stream(log), robot, options.log, logs.torque_at()));
  return how;
}

/// Rows from standard input as they arrive.
void run_live(const PayloadCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  const data::LogSet logs = open(options, robot);
  const payload::Options how = settings(options, robot, logs);
  const std::size_t zeros = options.zeros.size();
  const payload::UnloadedArm arm =
      options.baselines.empty()
          ? payload::arm_from_file(robot, model::read_model(options.robot.model), logs, zeros, how)
          : payload::fit_unloaded(robot, logs, zeros, how);
  for (const std::string& line : arm.notes) note(line);
  note(report::brief(arm));
  payload::LiveLoad live(arm, how);
  LiveRows rows(options.stream, options.log, robot, logs.torque_at());
  LiveOutput output(options.result);
  for (data::LiveRow row; output.is_read() && rows.next(row);) {
    if (const std::optional<payload::LiveEvent> event = live.push(row))
      output.print(report::brief(*event), report::json(*event));
  }
  const payload::LiveSummary summary = live.end(rows.refused());
  output.print(report::brief(summary), report::json(summary));
  if (!summary.unanswered.empty()) throw NotIdentifiableError(options.stream + ": " + summary.unanswered);
}

/// The load for a robot's controller or a model file.
void write_load(const PayloadCommandOptions& options, const Console& console, const payload::Payload& load,
                const model::Robot& robot) {
  const exchange::LoadOptions how{options.transition_time, robot.tip_link};
  const std::string text = exchange::to_text(exchange::load_of(load.body(), load.log), options.format, how);
  for (const exchange::LoadFormat& format : exchange::load_formats()) {
    if (format.id == options.format) console.print("{}", report::full(load, format, text));
  }
  if (options.load_file.empty()) return;
  host::write_file_atomically(options.load_file, text);
  if (!host::is_standard_output(options.load_file)) console.print("Written: {}\n", options.load_file);
}

void run(const PayloadCommandOptions& options) {
  const Console console{options.output, options.result.json, options.load_file};
  const model::Robot robot = load_robot(options.robot);
  const data::LogSet logs = open(options, robot);
  payload::Options how = settings(options, robot, logs);
  payload::Weighing found;
  {
    Steps steps;
    how.progress = [&](const std::string& what, double done) { steps.update(what, done); };
    const std::size_t zeros = options.zeros.size();
    found = options.baselines.empty()
                ? payload::weigh(robot, model::read_model(options.robot.model), logs, zeros, how)
                : payload::weigh(robot, logs, zeros, how);
  }
  for (const std::string& text : found.notes()) note(text);
  console.print("{}", report::full(found));
  // A model that contradicts a log of the arm must not be used.
  finish(console, found.contradicted() ? "" : options.output, options.result, report::json(found),
         report::page(found), [&] { model::write_model(options.output, found.model_file()); });
  if (!found.unanswered().empty()) throw NotIdentifiableError(found.unanswered());
  if (!options.format.empty()) write_load(options, console, found.loads.front(), robot);
}

}  // namespace

Action set_up_payload(CommandLine line) {
  auto options = std::make_shared<PayloadCommandOptions>();
  add_stream_argument(line, options->stream);
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  line.get_option("--log").required(false);
  add_accept_torque_option(line, options->log);
  line.add_option("--baseline", options->baselines,
                  "log of the arm without load, to fit the model to; may be given several times")
      .type_name("NOLOAD.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option(
          "--zero", options->zeros,
          "log without load that the model was not fitted to: the mass found there is the model's error, and "
          "widens the interval; may be given several times (default with several --baseline: each by the "
          "model of the others)")
      .type_name("NOLOAD.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--rows", options->rows, "K: use the torques of joints K..N")
      .type_name("K")
      .positive()
      .capture_default_str();
  line.add_option("--true-mass", options->true_mass,
                  "[kg] the load's mass where it is known: shown with the estimate")
      .type_name("KG")
      .positive();
  line.add_option("--write", options->format,
                  "print the load for a robot's controller or a model file (one --log)")
      .type_name("FORMAT")
      .one_of({"ur-script", "ur-ros2", "franka", "franka-desk", "kuka", "abb", "fanuc", "urdf", "mjcf"});
  line.add_option("--write-to", options->load_file, "file for what --write prints; - is standard output")
      .type_name("FILE")
      .names_file(FileUse::kOutput)
      .needs(line.get_option("--write"));
  line.add_option("--transition-time", options->transition_time,
                  "[s] time in which a UR controller changes to the load (--write ur-script, ur-ros2)")
      .type_name("S")
      .not_negative()
      .needs(line.get_option("--write"));
  add_output_option(line, options->output, "the model that --baseline gives (JSON), for --model next time",
                    false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options, line] {
    if (!options->stream.empty()) {
      refuse_with_stream(line, options->stream, options->result,
                         {"--log", "--output", "--true-mass", "--write"});
    } else if (options->log.logs.empty()) {
      throw UsageError("give a log with the load with --log LOG.csv, or '-' for rows on standard input");
    }
    if (!options->format.empty() && options->log.logs.size() > 1)
      throw UsageError("--write prints one load; expected one --log with it");
    if (options->robot.model.empty() == options->baselines.empty()) {
      throw UsageError(
          "the load is what the model of the arm without load does not explain: give either --model "
          "MODEL.json or --baseline NOLOAD.csv, a log to fit it to");
    }
    refuse_output_without(options->baselines, options->output, "the model that --baseline gives");
  });
  line.footer(
      "Logs need torque (tau1..tauN, or currents with --torque-constant). The arm without load is fitted by "
      "recursive\n"
      "least squares over all joints; its errors go into the interval. Where its logs hold the controller's target "
      "torque\n"
      "(tauref1..tauN), the error of the torque constants is taken off the load and goes into the interval, too; "
      "without,\n"
      "torque constants that are 2 % off move the mass by 2 %.\n"
      "With one log --json gives one object, with several a list; of a stream a line for each event.\n"
      "Example: heft payload --urdf ur10e --baseline empty.csv --log carrying.csv --report load.html -o bare.json\n"
      "         recorder | heft payload - --urdf ur10e --model bare.json\n"
      "         heft payload --urdf ur10e --model bare.json --log carrying.csv --write ur-script");
  return [options] { options->stream.empty() ? run(*options) : run_live(*options); };
}

}  // namespace heft::tools
