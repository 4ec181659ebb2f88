/// @file
/// heft diagnose: what a model of rigid bodies and simple friction lacks, judged on logs it has not seen.
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command.hpp"
#include "console.hpp"
#include "coupling_option.hpp"
#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/error.hpp"
#include "heft/host/words.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/diagnosis.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct DiagnoseOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  std::vector<std::string> validate;
  std::vector<std::string> couplings;
  double cutoff{0.0};
  std::string model;
  bool no_refit{false};
  bool refit{false};  // the default now
  bool trace{false};
};

data::LogSet open(const DiagnoseOptions& options, const model::Robot& robot) {
  data::LogFiles files = files_of(options.log, robot, options.validate);
  files.cutoff = 0.0;  // --band is that of the errors; the search chooses the low-pass of the motion
  return open_logs(robot, files);
}

/// The line that gives the same result, without the files to write.
std::string command_line(const DiagnoseOptions& options) {
  std::string line = "heft diagnose";
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) line += fmt::format(" {} {}", name, host::shell_word(value));
  };
  add("--urdf", options.robot.urdf);
  add("--model", options.robot.model);
  add("--base", options.robot.base);
  add("--tip", options.robot.tip);
  add("--mount", fmt::format("{}", fmt::join(options.robot.mount, ",")));
  for (const std::string& log : options.log.logs) add("--log", log);
  for (const std::string& log : options.validate) add("--validate", log);
  add("--torque-constant", fmt::format("{}", fmt::join(options.log.torque_constant, ",")));
  if (options.log.torque_at != "motor") add("--torque-at", options.log.torque_at);
  if (options.log.band > 0.0) add("--band", fmt::format("{}", options.log.band));
  for (const std::string& coupling : options.couplings) add("--coupling", coupling);
  if (options.cutoff > 0.0) add("--cutoff", fmt::format("{}", options.cutoff));
  if (options.no_refit) line += " --no-refit";
  return line;
}

void run(const DiagnoseOptions& options) {
  const Console console{options.result.json, options.model};
  diagnose::DiagnoseOptions asked;
  asked.couplings = couplings_of(options.couplings);  // wrong usage comes before bad files
  const model::Robot robot = load_robot(options.robot);
  const data::LogSet logs = open(options, robot);
  const host::Judgement torque = judge_torque(logs, robot, options.log);

  asked.band = options.log.band;
  asked.cutoff = options.cutoff;
  asked.refit = !options.no_refit;
  if (options.trace) asked.trace = [](const std::string& line) { print_to(stderr, line + "\n"); };
  diagnose::Diagnosis diagnosis;
  {
    Progress progress("diagnosing");
    asked.progress = [&](const std::string& what, double done) { progress.update(done, what); };
    diagnosis = diagnose::diagnose(robot, logs, asked);
  }

  const report::DiagnosisContext context{options.log.logs, options.validate, options.log.torque_at,
                                         command_line(options), torque};
  console.print("{}", report::full(diagnosis, context));
  finish(console, options.model, options.result, report::json(diagnosis, context),
         report::page(diagnosis, context),
         [&] { model::write_model(options.model, report::model_file(diagnosis)); });
}

}  // namespace

Action set_up_diagnose(CommandLine line) {
  auto options = std::make_shared<DiagnoseOptions>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  line.add_option(
          "--validate", options->validate,
          "log to judge every effect on, of another motion than the training logs; may be given several "
          "times")
      .type_name("LOG")
      .names_file(FileUse::kMeasurements);
  line.add_option("--cutoff", options->cutoff,
                  "low-pass on the positions [Hz] (default: the one that leaves the smallest residual)")
      .type_name("HZ")
      .positive();
  add_coupling_option(line, options->couplings,
                      "gear coupling to look for in addition to the model's (default: 5,6 if there is none)");
  line.get_option("--band").description(
      "low-pass of the errors in band [Hz] (default: chosen from the motion); that of the positions is no "
      "lower");
  line.add_flag("--no-refit", options->no_refit,
                "write the model that the figures are of; otherwise it is fitted once more, to the validation logs as well, when "
                "the effects are decided and where that lowers the errors");
  line.add_flag("--refit", options->refit, "the default, accepted for older scripts");
  line.add_flag("--trace", options->trace, "log each step of the search to standard error");
  add_output_option(line, options->model, "model file with the effects found", false);
  add_result_options(line, options->result);
  line.parse_complete_callback([options] {
    if (!options->validate.empty()) return;
    throw UsageError(
        "give a log that the fit does not see with --validate LOG.csv: an effect is accepted only if it also "
        "lowers the error on another log. With one log only, cut it in two, each part with the header line: "
        "(head -n 1 LOG.csv; tail -n +K LOG.csv) > second.csv");
  });
  line.footer(
      "What heft identify fits, and the effects that are missing from it. An effect is accepted when it lowers\n"
      "the error on data not used for its fit by more than chance and by enough to matter. Rotor inertia and\n"
      "offset are in the model in any case, and named where the given one has no value for them.\n"
      "Example: heft diagnose --urdf ur10e --log a.csv --validate b.csv -o extended.json --report "
      "diagnosis.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
