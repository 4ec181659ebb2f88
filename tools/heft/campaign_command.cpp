#include "campaign_command.hpp"

#include "campaign_report.hpp"
#include "console.hpp"
#include "heft/data/log.hpp"
#include "heft/host/output_folder.hpp"
#include "heft/model/model_file.hpp"

namespace heft::tools {
namespace {

/// Logs and models of a campaign as files.
void write_campaign(const std::string& path, const studies::CampaignResult& result) {
  const host::OutputFolder folder(path);
  for (const studies::Experiment& experiment : result.experiments) {
    data::write_log(folder.file(experiment.name + ".csv"), experiment.log);
  }
  model::write_model(folder.file("truth.json"), result.true_model_file());
  model::write_model(folder.file("identified.json"), result.model_file());
}

}  // namespace

void run_campaign_command(const RobotOptions& given, const ResultOptions& results,
                          const CampaignOptions& options) {
  const Console console{results.json};
  RobotOptions robot = given;
  if (robot.urdf.empty()) robot.urdf = "ur10e";
  studies::CampaignSettings settings;
  settings.nominal = load_robot(robot);
  settings.seed = options.seed;
  settings.repeats = options.repeats;
  settings.duration = options.duration;
  settings.traces = !results.report.empty();
  studies::CampaignResult result;
  {
    Progress progress("campaign");
    result = studies::run_campaign(settings, [&](double done, const std::string&) { progress.update(done); });
  }
  const studies::StudyReport report = studies::campaign_report(settings, result);
  console.print("{}", report.text);
  finish(console, options.output, results, report.json_text(), report.page,
         [&] { write_campaign(options.output, result); });
}

}  // namespace heft::tools
