/// @file
/// heft validate: a model judged on logs it has not seen, or a whole simulated campaign against its truth.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "campaign_command.hpp"
#include "command.hpp"
#include "console.hpp"
#include "heft/report/validation.hpp"
#include "heft/validate/validate.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct ValidateOptions {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  bool torque_at_given{false};
  bool campaign{false};
  CampaignOptions of_campaign;
};

void judge_logs(const ValidateOptions& options) {
  const Console console{options.result.json};
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  data::LogFiles files = files_of(options.log, loaded.robot);
  files.judge.swap(files.train);
  // The model knows where the torque was measured, if nothing was said.
  if (!options.torque_at_given && loaded.fit && loaded.fit->torque_at == "joint")
    files.torque_at = TorqueAt::kJoint;
  const data::LogSet logs = open_logs(loaded.robot, files);
  validate::Options asked;
  asked.band = options.log.band;
  asked.model = options.robot.model;
  asked.urdf = options.robot.urdf;
  asked.traces = !options.result.report.empty();
  asked.torque = judge_torque(logs, loaded.robot, options.log);
  validate::Validation judged;
  {
    Progress progress("judging");
    asked.progress = [&](const std::string& log, double done) { progress.update(done, log); };
    judged =
        validate::validate(loaded.robot, loaded.fit ? &*loaded.fit : nullptr, loaded.fitted_to, logs, asked);
  }
  for (const std::string& text : judged.notes) note(text);
  console.print("{}", report::full(judged));
  finish(console, "", options.result, report::json(judged), report::page(judged));
}

}  // namespace

Action set_up_validate(CommandLine line) {
  auto options = std::make_shared<ValidateOptions>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  // Asked for below, since a campaign needs none.
  line.get_option("--log").required(false);
  line.add_flag("--campaign", options->campaign,
                "simulate a measuring campaign of a robot (default: ur10e) whose true parameters are known, "
                "identify it "
                "and judge all five criteria");
  line.add_option("--seed", options->of_campaign.seed, "of a campaign: its true arm, motions and noise")
      .type_name("N")
      .capture_default_str();
  line.add_option("--repeats", options->of_campaign.repeats, "of a campaign: experiments without load")
      .type_name("N")
      .between(2, 1000)
      .capture_default_str();
  line.add_option("--duration", options->of_campaign.duration, "of a campaign: length of an experiment [s]")
      .type_name("S")
      .between(5.0, 600.0)
      .capture_default_str();
  add_output_option(line, options->of_campaign.output, "of a campaign: folder for its logs and models",
                    false);
  line.get_option("--output").type_name("FOLDER").names_file(FileUse::kOutputFolder);
  add_result_options(line, options->result);
  line.parse_complete_callback([options, line] {
    options->torque_at_given = line.count("--torque-at") > 0;
    if (options->campaign) {
      if (!options->log.logs.empty()) {
        throw UsageError("--campaign makes its own logs: leave out --log");
      }
      return;
    }
    if (options->robot.model.empty() && options->robot.urdf.empty()) {
      throw UsageError("give the model to judge with --model MODEL.json, or --campaign");
    }
    if (options->log.logs.empty()) {
      throw UsageError("give the log to judge it on with --log LOG.csv");
    }
    for (const char* of_campaign : {"--seed", "--repeats", "--duration", "--output"}) {
      if (line.count(of_campaign) > 0) {
        throw UsageError(fmt::format("{} belongs to --campaign, which was not asked for", of_campaign));
      }
    }
  });
  line.footer(
      "A model file of heft knows its robot; older ones need --urdf. With --urdf alone the URDF itself is "
      "judged.\n"
      "The criteria: parameter recovery < 15 %, torque prediction < 3 %, tracking error reduced > 40 %, "
      "payload\n"
      "generalisation < 5 %, repeatability < 10 %. Logs show the second; --campaign judges all five.\n"
      "Example: heft validate --model arm.json --log unseen.csv --report judged.html\n"
      "         heft validate --campaign --urdf ur10e --seed 1 --report campaign.html");
  return [options] {
    options->campaign ? run_campaign_command(options->robot, options->result, options->of_campaign)
                      : judge_logs(*options);
  };
}

}  // namespace heft::tools
