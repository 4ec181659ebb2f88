/// @file
/// heft monitor: contacts in a log, found as a controller would find them.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/error.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/report/monitor.hpp"
#include "live_stream.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct MonitorOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::string stream;
  std::vector<std::string> learn;
  std::string output;
  double rate{1.0};
  bool free{false};
  bool torque_at_given{false};
};

/// Thresholds of the file, where nothing is to be learnt.
monitor::Thresholds known_thresholds(const model::ModelFile& file) {
  const std::optional<monitor::Thresholds> known = monitor::thresholds_of(file);
  if (known) return *known;
  throw ModelError(fmt::format(
      "{}: /contact_thresholds: missing; expected thresholds of contacts; learn them with --learn FREE.csv",
      file.path));
}

/// Logs to learn from and logs to judge, measured where the model or its thresholds were unless something was said.
data::LogSet open(const MonitorOptions& options, const LoadedRobot& loaded, const model::ModelFile& file) {
  data::LogFiles files = files_of(options.log, loaded.robot, options.log.logs);
  files.train = options.learn;
  files.split = 0.0;
  const std::optional<monitor::Thresholds> known = monitor::thresholds_of(file);
  const bool at_joint = options.learn.empty() && known ? known->at() == TorqueAt::kJoint
                                                       : loaded.fit && loaded.fit->torque_at == "joint";
  if (!options.torque_at_given && at_joint) files.torque_at = TorqueAt::kJoint;
  return open_logs(loaded.robot, files);
}

/// Rows from standard input as they arrive.
void run_live(const MonitorOptions& options) {
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  const model::ModelFile file = model::read_model(options.robot.model);
  const monitor::Thresholds thresholds = known_thresholds(file);
  monitor::LiveContacts contacts(file, loaded.robot, thresholds);
  for (const std::string& line : contacts.notes()) note(line);
  LiveRows rows(options.stream, options.log, loaded.robot, thresholds.at());
  LiveOutput output(options.result);
  for (data::LiveRow row; output.is_read() && rows.next(row);) {
    for (const monitor::LiveContact& event : contacts.push(row))
      output.print(report::brief(event), report::json(event));
  }
  const monitor::LiveSummary summary = contacts.end(rows.refused());
  output.print(report::brief(summary), report::json(summary));
  if (!summary.unanswered.empty()) throw NotIdentifiableError(options.stream + ": " + summary.unanswered);
}

void run(const MonitorOptions& options) {
  const Console console{options.output, options.result.json};
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  const model::ModelFile file = model::read_model(options.robot.model);
  const data::LogSet logs = open(options, loaded, file);
  monitor::Options asked;
  asked.false_alarms_per_hour = options.rate;
  asked.known_free = options.free;
  asked.traces = !options.result.report.empty();
  asked.torque = judge_torque(logs, loaded.robot, options.log);
  monitor::Thresholds thresholds;
  std::vector<monitor::Contacts> found;
  {
    Progress progress("monitor");
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    thresholds =
        options.learn.empty() ? known_thresholds(file) : monitor::learn(file, loaded.robot, logs, asked);
    found = monitor::monitor(file, loaded.robot, logs, thresholds, asked);
  }
  std::string text = options.learn.empty() ? std::string() : report::full(thresholds);
  for (const std::string& line : thresholds.notes) note(line);
  for (const monitor::Contacts& one : found) {
    for (const std::string& line : one.notes) note(line);
    text += (text.empty() ? "" : "\n") + report::full(one);
  }
  console.print("{}", text);
  finish(console, options.output, options.result,
         found.empty() ? report::json(thresholds) : report::json(found), report::page(thresholds, found),
         [&] { model::write_model(options.output, thresholds.model_file(file)); });
}

}  // namespace

Action set_up_monitor(CommandLine line) {
  auto options = std::make_shared<MonitorOptions>();
  add_stream_argument(line, options->stream);
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.get_option("--log").required(false).description(
      "log to look for contacts in; may be given several times");
  line.add_option(
          "--learn", options->learn,
          "log of the robot at its usual work, untouched, to learn the thresholds from; may be given several times")
      .type_name("FREE.csv")
      .names_file(FileUse::kMeasurements);
  line.add_option("--rate", options->rate, "false alarms that free motion may cause [1/h]")
      .type_name("PER_HOUR")
      .positive()
      .capture_default_str();
  line.add_flag("--free", options->free,
                "nothing touched the arm in the logs of --log: contacts found are counted as false alarms");
  add_output_option(line, options->output,
                    "copy of the model with the thresholds learnt, for monitor and export", false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options, line] {
    options->torque_at_given = line.count("--torque-at") > 0;
    if (!options->stream.empty()) {
      refuse_with_stream(line, options->stream, options->result,
                         {"--log", "--learn", "--free", "--output", "--torque-at", "--rate", "--band"});
    }
    if (line.count("--rate") > 0 && options->learn.empty()) {
      throw UsageError(
          "--rate is the rate of false alarms that thresholds are learnt for: give --learn FREE.csv with it");
    }
    if (options->free && options->log.logs.empty()) {
      throw UsageError("--free is about the logs of --log: give one with it");
    }
    if (options->robot.model.empty()) {
      throw UsageError(
          "contacts are what a model of the arm does not explain: give one with --model MODEL.json; heft identify or heft "
          "diagnose makes it");
    }
    if (options->stream.empty() && options->learn.empty() && options->log.logs.empty()) {
      throw UsageError(
          "give a log to look for contacts in with --log LOG.csv, or logs to learn from with --learn FREE.csv");
    }
    refuse_output_without(options->learn, options->output, "the thresholds that --learn gives");
  });
  line.footer(
      "A joint has thresholds for rest, for turning round and for motion. Learn them from logs that the model was\n"
      "not fitted to, several recordings of all motions that the robot does. What is found is what a controller finds that runs "
      "heft::ContactMonitor\n"
      "with the header of heft export. With one log --json gives one object, with several a list.\n"
      "Example: heft monitor --model arm.json --learn free-a.csv --learn free-b.csv -o watched.json\n"
      "         heft monitor --model watched.json --log run.csv --report contacts.html\n"
      "         recorder | heft monitor - --model watched.json");
  return [options] { options->stream.empty() ? run(*options) : run_live(*options); };
}

}  // namespace heft::tools
