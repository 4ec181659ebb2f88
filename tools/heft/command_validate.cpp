/// @file
/// heft validate: a model judged on logs it has not seen, or a whole simulated campaign against its truth.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "campaign.hpp"
#include "command.hpp"
#include "console.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/output_folder.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/identify/physical.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/page/page.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/judgement.hpp"
#include "heft/validate/score.hpp"
#include "options.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::tools {
namespace {

struct Options {
  RobotOptions robot;
  LogOptions log;
  ResultOptions result;
  bool torque_at_given{false};
  bool campaign{false};
  std::uint64_t seed{1};
  int repeats{10};
  double duration{20.0};
  std::string output;
};

/// Place of the torque prediction among the acceptance criteria.
constexpr std::size_t kPrediction = 1;
/// Poses in which the mass matrix is looked at.
constexpr int kPoses = 2000;

std::string lines_of(const std::vector<validate::Criterion>& criteria) {
  std::string text;
  for (const validate::Criterion& criterion : criteria) {
    for (const std::string& line : criterion.notes) text += fmt::format("  {}: {}\n", criterion.name, line);
  }
  return text;
}

void add_notes(page::Page& page, const std::vector<validate::Criterion>& criteria) {
  for (const validate::Criterion& criterion : criteria) {
    for (const std::string& line : criterion.notes) page.note(fmt::format("{}: {}", criterion.name, line));
  }
}

void add_residual_words(page::Page& page, const validate::Score& score) {
  page::Table table({"joint", "residual"});
  for (int j = 0; j < score.num_joints(); ++j) {
    table.add_row({fmt::format("{}", j + 1), validate::describe_residual(score, j)});
  }
  page.table(table, "Residual: noise, or something that the model misses");
}

/// Mean over the joints that have a figure; a joint without torque has none.
std::string mean_percent(const Eigen::VectorXd& percent) {
  double sum = 0.0;
  int count = 0;
  for (const double value : percent) {
    if (!std::isfinite(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? fmt::format("{:.2f} %", sum / count) : "not known (no joint has torque)";
}

std::string mean_in_band(const validate::Score& score) {
  if (!(score.band > 0.0)) return "in band not known (the log is too short or too slowly sampled for a band)";
  return fmt::format("{} in band ({:.3g} Hz)", mean_percent(score.in_band_percent_of_max), score.band);
}

// Logs ---------------------------------------------------------------------------------------------------------

void judge_logs(const Options& options) {
  const Console console{options.result.json};
  const LoadedRobot loaded = load_robot_and_fit(options.robot);
  // Where the torque was measured goes without saying when the model knows.
  TorqueAt at = options.log.measured_at();
  if (!options.torque_at_given && loaded.fit && loaded.fit->torque_at == "joint") at = TorqueAt::kJoint;
  const model::Robot robot = as_measured(loaded, at);
  const int n = robot.num_joints();

  data::LogRequirements needs;
  needs.num_joints = n;
  needs.robot_name = robot.name;
  needs.torque = true;
  needs.torque_constant = options.log.torque_constant;
  data::StreamOptions streaming;
  streaming.motion.cutoff = options.log.band;
  double band = options.log.band;
  // Friction at low speed is judged as it was fitted: behind the same low-pass, with a sign as steep.
  const bool as_fitted = loaded.fit && loaded.fit->cutoff_hz > 0;
  if (as_fitted) {
    streaming.motion.cutoff = loaded.fit->cutoff_hz;
    streaming.motion.smooth_position = true;
    streaming.prefer_logged = false;
    if (band == 0) band = loaded.fit->band_hz;
  }
  streaming.displacement = goes_by_logged_displacement(robot);
  std::vector<data::MotionStream> streams;
  host::Judgement torque;
  bool seen = false;
  for (const std::string& path : options.log.logs) {
    if (std::find(loaded.fitted_to.begin(), loaded.fitted_to.end(), path) != loaded.fitted_to.end()) {
      note(fmt::format("{}: the model was fitted to this log; it says nothing about logs not seen", path));
      seen = true;
    }
    streams.emplace_back(path, needs, streaming);
    data::refuse_errors(streams.back().check(limits_of(robot)));
    torque.add(judge_torque(streams.back(), robot, options.log, at));
    for (const std::string& text : streams.back().summary().notes) note(text);
    // One band for all logs, or their figures could not be put together.
    if (options.log.band == 0 && !as_fitted) {
      band = std::max(band, validate::default_band(streams.back().summary().bandwidth));
    }
  }

  std::vector<validate::Score> scores;
  std::vector<TorqueTrace> traces;
  for (const data::MotionStream& stream : streams) {
    Progress progress(stream.summary().path);
    validate::ScoreOptions scoring;
    scoring.band = band;
    if (as_fitted && loaded.fit->sign_width > 0) scoring.sign_width = loaded.fit->sign_width;
    scoring.progress = [&](double done) { progress.update(done); };
    if (!options.result.report.empty()) {
      traces.emplace_back(stream.summary().samples, n);
      scoring.rows = [&](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                         const Eigen::MatrixXd& predicted) { traces.back().add(time, measured, predicted); };
    }
    scores.push_back(validate::score(robot, stream, scoring));
  }
  const validate::Score all = validate::pool(scores);

  std::vector<validate::Criterion> criteria = validate::acceptance_criteria();
  Eigen::Index worst = 0;
  double worst_percent = 0.0;
  std::string worst_log;
  for (const validate::Score& score : scores) {
    Eigen::Index joint = 0;
    // A log without a band is judged on its unfiltered error.
    const double percent =
        (score.band > 0 ? score.in_band_percent_of_max : score.percent_of_max).maxCoeff(&joint);
    if (percent > worst_percent) {
      worst_percent = percent;
      worst = joint;
      worst_log = score.log;
    }
  }
  validate::judge(criteria[kPrediction], worst_percent);
  criteria[kPrediction].notes.push_back(fmt::format("worst: joint {}{}; mean of the joints {}, {} unfiltered",
                                                    worst + 1, scores.size() > 1 ? " of " + worst_log : "",
                                                    mean_in_band(all), mean_percent(all.percent_of_max)));
  // Of the five criteria logs alone show this one; heft validate --campaign judges the others.
  const std::vector<validate::Criterion> shown{criteria[kPrediction]};

  // The model itself.
  model::FitRecord fit = loaded.fit.value_or(model::FitRecord{});
  if (!loaded.fit) {
    fit.condition_number = std::numeric_limits<double>::quiet_NaN();
    fit.physically_consistent = model::has_physical_links(robot);
  }
  std::string model_text = options.robot.model.empty()
                               ? fmt::format("Model: the parameters of {}.", options.robot.urdf)
                               : fmt::format("Model: {}", options.robot.model);
  if (loaded.fit && fit.base_parameters.empty()) {
    model_text += fmt::format(" ({}).", fit.method);
  } else if (loaded.fit) {
    const auto determined = std::count_if(fit.base_parameters.begin(), fit.base_parameters.end(),
                                          [](const model::BaseParameterRecord& p) { return p.determined; });
    model_text += fmt::format(" ({}, {} of {} base parameters determined, condition number {}).", fit.method,
                              determined, fit.base_parameters.size(), page::number(fit.condition_number, 3));
  }
  model_text += fit.physically_consistent ? " Every link is physically possible."
                                          : " At least one link is physically impossible.";
  validate::ModelFacts facts;
  facts.parameters = static_cast<int>(fit.base_parameters.size());
  facts.determined =
      static_cast<int>(std::count_if(fit.base_parameters.begin(), fit.base_parameters.end(),
                                     [](const model::BaseParameterRecord& p) { return p.determined; }));
  facts.physically_consistent = fit.physically_consistent;
  facts.mass = model::check_mass_matrix(robot, kPoses, 1);
  host::Judgement judgement = validate::judge_prediction(scores);
  judgement.add(torque);
  judgement.add(validate::judge_model(facts));
  if (seen) {
    judgement.add(host::Verdict::kDoubtful,
                  "the model was fitted to the log that it is judged on: give one that the fit has not seen");
  }
  const std::string answer = fmt::format(
      "The model misses the measured torque by {:.3g} % of the joint's largest torque in the worst joint "
      "({}), {}.",
      worst_percent, worst + 1, all.band > 0 ? fmt::format("below {:.3g} Hz", all.band) : "unfiltered");

  nlohmann::ordered_json json{{"robot", robot.name},
                              {"model", options.robot.model},
                              {"torque_at", at == TorqueAt::kMotor ? "motor" : "joint"}};
  put_verdict(json, judgement);
  json.update(validation_json(all));
  json.update(fit_json(fit));
  json["criteria"] = criteria_json(criteria);
  json["logs"] = nlohmann::ordered_json::array();
  for (const validate::Score& score : scores) {
    nlohmann::ordered_json entry{{"log", score.log}};
    entry.update(validation_json(score));
    json["logs"].push_back(std::move(entry));
  }

  const std::string meaning = score_meaning(all) + validation_meaning();
  console.print("{}\n{}\n{}\n", answer, verdict_text(judgement), model_text);
  for (const validate::Score& score : scores) {
    console.print("{}: {} samples\n{}", score.log, score.samples, validation_text(score));
  }
  if (scores.size() > 1) {
    console.print("All {} logs together, {} samples\n{}", scores.size(), all.samples, validation_text(all));
  }
  console.print("{}\nResidual:\n", meaning);
  for (int j = 0; j < n; ++j) console.print("  joint {}: {}\n", j + 1, validate::describe_residual(all, j));
  console.print("Acceptance (the criterion that logs can show):\n{}{}", criteria_table(shown).to_text(2),
                lines_of(shown));

  page::Page page = new_page(fmt::format("{}: model judged", robot.name), file_names_of(options.log.logs));
  for (const data::MotionStream& stream : streams) add_log_line(page, log_line(stream));
  page.verdict(answer, judgement);
  page.paragraph(model_text);
  page.table(criteria_table(shown),
             "The acceptance criterion that logs can show; heft validate --campaign judges all five");
  add_notes(page, shown);
  for (std::size_t k = 0; k < scores.size(); ++k) {
    page.heading(file_name_of(scores[k].log));
    page.table(validation_table(scores[k]), meaning + moving_line(scores[k]));
    if (k < traces.size()) {
      page.plots("Torque over time", small(traces[k].torque_plots()));
      page.plots("Torque error over time", small(traces[k].residual_plots()));
    }
    add_residual_words(page, scores[k]);
  }
  if (!fit.base_parameters.empty()) page.table(base_parameter_table(fit), "Base parameters of the fit");
  for (const std::string& line : fit.missing) page.note(line);
  finish(console, "", options.result, json, page);
}

// Campaign -----------------------------------------------------------------------------------------------------

std::string campaign_text(const studies::CampaignSettings& settings, const studies::CampaignResult& result) {
  std::string loads;
  for (const double payload : settings.payloads)
    loads += fmt::format("{}{:g}", loads.empty() ? "" : ", ", payload);
  return fmt::format(
      "Simulated arm: {} with the mass, centre of mass and central inertia of every link off by 10 to 25 %, "
      "and drives "
      "with rotor inertia, Coulomb and viscous friction and an offset. Forward dynamics by SUNDIALS, "
      "sticking friction, "
      "{:g} Hz, computed torque in the loop. Normally distributed noise, standard deviations: encoder {:g} "
      "rad (the loop "
      "closes on it too), torque {:g} N·m. Loads {} and {:g} kg; {} experiments of {:g} s without load that "
      "differ in "
      "noise. Seed {}: the arm and the exciting motion {}, the motion judged on {}, noise from {} on.",
      settings.nominal.name, settings.sample_rate, settings.position_noise, settings.torque_noise, loads,
      settings.judged_payload, settings.repeats, settings.duration, settings.seed, settings.seed,
      settings.seed + 1000, result.experiments.front().seed);
}

page::Table parameter_table(const studies::CampaignResult& result) {
  page::Table table({"base parameter", "true", "found", "± (95 %)", "unit", "error [%]", "scatter [%]",
                     "torque share [%]", "counted"});
  for (int i = 0; i < result.fit.base.count(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    // Beside a truth of 0 there is nothing to be relative to.
    const double share = result.beta_true[i] == 0.0 ? std::numeric_limits<double>::quiet_NaN() : 100.0;
    const char* counted = result.counted.counted[at]  ? "yes"
                          : result.fit.determined[at] ? "no"
                                                      : "no: the log does not tell it";
    table.add_row({result.fit.base.name(*result.fit.columns, i), page::number(result.beta_true[i]),
                   page::number(result.fit.beta[i]), page::number(result.fit.half_width[i], 2),
                   (*result.fit.columns)[result.fit.base.kept[at]].unit,
                   page::number(share * result.errors[i], 3), page::number(share * result.scatter[i], 3),
                   page::number(100.0 * result.shares[i], 3), counted});
  }
  return table;
}

page::Table tracking_table(const studies::CampaignResult& result) {
  std::vector<std::string> header{"computed torque with"};
  const Eigen::Index n = result.tracking.front().rms.size();
  for (Eigen::Index j = 0; j < n; ++j) header.push_back(fmt::format("joint {} [mrad]", j + 1));
  header.emplace_back("all [mrad]");
  page::Table table(header);
  for (const studies::TrackingResult& tracking : result.tracking) {
    std::vector<std::string> row{tracking.name};
    for (const double rms : tracking.rms) row.push_back(page::number(1e3 * rms, 3));
    row.push_back(page::number(1e3 * tracking.total(), 3));
    table.add_row(row);
  }
  return table;
}

page::Table payload_table(const studies::CampaignResult& result) {
  page::Table table({"identified with [kg]", "judged with [kg]", "worst joint, RMSE [% of max]",
                     "worst joint, in band [% of max]", "mean of the joints [% of max]"});
  for (const studies::PayloadScore& entry : result.payloads) {
    table.add_row({fmt::format("{:g}", entry.trained), fmt::format("{:g}", entry.judged),
                   page::number(entry.score.percent_of_max.maxCoeff(), 3),
                   page::number(entry.score.in_band_percent_of_max.maxCoeff(), 3),
                   page::number(entry.score.percent_of_max.mean(), 3)});
  }
  return table;
}

nlohmann::ordered_json campaign_json(const studies::CampaignSettings& settings,
                                     const studies::CampaignResult& result) {
  nlohmann::ordered_json json{{"robot", settings.nominal.name},
                              {"seed", settings.seed},
                              {"sample_rate", settings.sample_rate},
                              {"duration", settings.duration},
                              {"position_noise_std", settings.position_noise},
                              {"torque_noise_std", settings.torque_noise},
                              {"payloads", settings.payloads},
                              {"repeats", settings.repeats},
                              {"criteria", criteria_json(result.criteria)}};
  json.update(validation_json(result.holdout));
  json.update(fit_json(identify::fit_record(result.fit, "motor")));
  for (Eigen::Index i = 0; i < result.errors.size(); ++i) {
    nlohmann::ordered_json& entry = json["base_parameters"][static_cast<std::size_t>(i)];
    entry["true"] = result.beta_true[i];
    entry["relative_error"] = result.errors[i];
    entry["scatter"] = std::isfinite(result.scatter[i]) ? nlohmann::ordered_json(result.scatter[i])
                                                        : nlohmann::ordered_json(nullptr);
    entry["torque_share"] = result.shares[i];
    entry["counted"] = static_cast<bool>(result.counted.counted[static_cast<std::size_t>(i)]);
  }
  json["payload_scores"] = nlohmann::ordered_json::array();
  for (const studies::PayloadScore& entry : result.payloads) {
    json["payload_scores"].push_back(
        {{"identified_with", entry.trained},
         {"judged_with", entry.judged},
         {"rmse_percent_of_max", json_array(entry.score.percent_of_max)},
         {"rmse_in_band_percent_of_max", json_array(entry.score.in_band_percent_of_max)}});
  }
  json["load_difference"] = {{"value", result.load_difference},
                             {"std", result.load_difference_std},
                             {"true", result.load_difference_true}};
  json["tracking"] = nlohmann::ordered_json::array();
  for (const studies::TrackingResult& tracking : result.tracking) {
    json["tracking"].push_back({{"model", tracking.name}, {"rms_error", json_array(tracking.rms)}});
  }
  return json;
}

void add_campaign_plots(page::Page& page, const studies::CampaignResult& result) {
  const auto judged =
      std::find_if(result.experiments.begin(), result.experiments.end(),
                   [](const studies::Experiment& e) { return !e.exciting && e.payload == 0; });
  const data::MotionStream stream(judged->log);
  TorqueTrace trace(stream.summary().samples, result.holdout.num_joints());
  validate::ScoreOptions scoring;
  scoring.band = result.holdout.band;
  scoring.rows = [&](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                     const Eigen::MatrixXd& predicted) { trace.add(time, measured, predicted); };
  (void)validate::score(result.fit.robot, stream, scoring);
  page.plots("Torque on the motion judged on", small(trace.torque_plots()));
  page.plots("Torque error", small(trace.residual_plots()));
  std::vector<page::PlotSpec> plots;
  for (Eigen::Index j = 0; j < result.tracking.front().rms.size(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "error [mrad]";
    for (std::size_t k = 0; k < 2; ++k) {
      const studies::TrackingResult& tracking = result.tracking[k];
      spec.series.push_back(page::line(tracking.name, tracking.time, 1e3 * tracking.error.col(j),
                                       k == 0 ? page::Hue::kNeutral : page::Hue::kBlue));
    }
    plots.push_back(std::move(spec));
  }
  page.plots("Tracking error of computed torque", small(std::move(plots)));
}

/// Logs and models of a campaign as files.
void write_campaign(const std::string& path, const studies::CampaignResult& result) {
  const host::OutputFolder folder(path);
  for (const studies::Experiment& experiment : result.experiments) {
    data::write_log(folder.file(experiment.name + ".csv"), experiment.log);
  }
  model::ModelFile truth = model::make_model(result.truth);
  truth.provenance.method = "simulated truth";
  model::write_model(folder.file("truth.json"), truth);
  model::ModelFile fitted = result.fit.model_file();
  fitted.provenance.logs = {result.experiments.front().name + ".csv"};
  model::write_model(folder.file("identified.json"), fitted);
}

void run_simulated(const Options& options) {
  const Console console{options.result.json};
  studies::CampaignSettings settings;
  RobotOptions robot = options.robot;
  if (robot.urdf.empty()) robot.urdf = "ur10e";
  settings.nominal = load_robot(robot);
  settings.seed = options.seed;
  settings.repeats = options.repeats;
  settings.duration = options.duration;
  studies::CampaignResult result;
  {
    Progress progress("campaign");
    result = studies::run_campaign(settings, [&](double done, const std::string&) { progress.update(done); });
  }
  const host::Judgement judgement = validate::judge(result.criteria);
  nlohmann::ordered_json json = campaign_json(settings, result);
  put_verdict(json, judgement);

  const std::string text = campaign_text(settings, result);
  const std::string counted = fmt::format(
      "Parameters counted: base parameters that the log determined and that move at least {:g} % of a "
      "joint's torque on "
      "the motion judged on.",
      100.0 * identify::kCountedShare);
  const std::string tracking = fmt::format(
      "Tracking: the same loop on the motion judged on, against the true positions. \"{}\" has the URDF's "
      "links and the "
      "drives' catalogue values, as far off as the links; the criterion is against it, for against the URDF "
      "alone, whose "
      "drives have neither friction nor rotors, anything would win.",
      result.tracking.front().name);
  const std::string meaning = score_meaning(result.holdout) + validation_meaning();
  console.print("{}\n{}{}{}\n{}", text, criteria_table(result.criteria).to_text(2), lines_of(result.criteria),
                criteria_summary(result.criteria) + ".", verdict_text(judgement));
  console.print("{}\nTorque on the motion judged on, without load:\n{}{}\n", counted,
                validation_text(result.holdout), meaning);
  console.print("Loads:\n{}", payload_table(result).to_text(2));
  console.print("{}\n{}", tracking, tracking_table(result).to_text(2));

  page::Page page = new_page(fmt::format("{}: simulated campaign", settings.nominal.name),
                             fmt::format("seed {}", settings.seed));
  page.verdict(criteria_summary(result.criteria) + ".", judgement);
  page.table(criteria_table(result.criteria), "Acceptance criteria");
  add_notes(page, result.criteria);
  page.paragraph(text);
  page.paragraph(
      fmt::format("Condition number of the exciting motion's base regressor, unit columns: {:.3g}; of the "
                  "fit's weighted one: {:.3g}.",
                  result.condition, result.fit.condition));
  page.heading("Parameters");
  page.table(parameter_table(result), counted);
  page.heading("Torque");
  page.table(validation_table(result.holdout), meaning + moving_line(result.holdout));
  add_residual_words(page, result.holdout);
  page.table(
      payload_table(result),
      fmt::format("Each model on the motion judged on, band {:.3g} Hz; in the last row the known difference "
                  "of the loads is added to the model",
                  result.holdout.band));
  page.heading("Tracking");
  page.table(tracking_table(result), tracking);
  if (!options.result.report.empty()) add_campaign_plots(page, result);
  finish(console, options.output, options.result, json, page,
         [&] { write_campaign(options.output, result); });
}

}  // namespace

Action set_up_validate(CommandLine line) {
  auto options = std::make_shared<Options>();
  add_robot_options(line, options->robot);
  add_log_options(line, options->log);
  add_accept_torque_option(line, options->log);
  // Asked for below, since a campaign needs none.
  line.get_option("--log").required(false);
  line.add_flag("--campaign", options->campaign,
                "simulate a measuring campaign of a robot (default: ur10e) whose true parameters are known, "
                "identify it "
                "and judge all five criteria");
  line.add_option("--seed", options->seed, "of a campaign: its true arm, motions and noise")
      .type_name("N")
      .capture_default_str();
  line.add_option("--repeats", options->repeats, "of a campaign: experiments without load")
      .type_name("N")
      .between(2, 1000)
      .capture_default_str();
  line.add_option("--duration", options->duration, "[s] of a campaign: length of an experiment")
      .type_name("S")
      .between(5.0, 600.0)
      .capture_default_str();
  add_output_option(line, options->output, "of a campaign: folder for its logs and models", false);
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
      "generalisation < 5 %, repeatability < 10 %. Logs tell the second; --campaign judges all five.\n"
      "Example: heft validate --model arm.json --log unseen.csv --report judged.html\n"
      "         heft validate --campaign --urdf ur10e --seed 1 --report campaign.html");
  return [options] { options->campaign ? run_simulated(*options) : judge_logs(*options); };
}

}  // namespace heft::tools
