/// @file
/// heft payload: the load at the flange, estimated sample by sample over a log.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/error.hpp"
#include "heft/model/model_file.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/payload.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::vector<std::string> baselines;
  std::vector<std::string> zeros;
  std::string output;
  int rows{1};
  double true_mass{0.0};
};

/// The logs without load to fit to, then those that check the model and those with the load.
data::LogSet open(const Options& options, const model::Robot& robot) {
  std::vector<std::string> judge = options.zeros;
  judge.insert(judge.end(), options.log.logs.begin(), options.log.logs.end());
  data::LogFiles files = files_of(options.log, robot, judge);
  files.train = options.baselines;
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

void run(const Options& options) {
  const Console console{options.output, options.result.json};
  const model::Robot robot = load_robot(options.robot);
  const data::LogSet logs = open(options, robot);
  payload::Options how;
  how.first_joint = options.rows;
  how.cutoff = options.log.band;
  how.torque_at = logs.torque_at();
  how.true_mass = options.true_mass;
  for (const data::LogSource& log : logs.given())
    how.torque.push_back(judge_torque(data::stream(log), robot, options.log, logs.torque_at()));
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
}

}  // namespace

Action set_up_payload(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
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
  add_output_option(line, options->output, "the model that --baseline gives (JSON), for --model next time",
                    false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    if (options->robot.model.empty() == options->baselines.empty()) {
      throw UsageError(
          "the load is what the model of the arm without load does not explain: give either --model "
          "MODEL.json or --baseline NOLOAD.csv, a log to fit it to");
    }
    if (options->baselines.empty() && !options->output.empty()) {
      throw UsageError(
          "--output writes the model that --baseline gives; with --model there is nothing to write");
    }
  });
  line.footer(
      "Logs need torque (tau1..tauN, or currents with --torque-constant). The arm without load is fitted by "
      "recursive\n"
      "least squares over all joints; its errors go into the interval. The interval holds for the torque "
      "scale given:\n"
      "a torque constant that is 2 % off moves the mass by 2 %.\n"
      "With one log --json gives one object, with several a list.\n"
      "Example: heft payload --urdf ur10e --baseline empty.csv --log carrying.csv --report load.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
