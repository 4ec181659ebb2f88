#include "heft/report/validation.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/model/physical_links.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using validate::Criterion;
using validate::Score;
using validate::Validation;

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

std::string mean_in_band(const Score& score) {
  if (!(score.band > 0.0)) return "in band not known (the log is too short or too slowly sampled for a band)";
  return fmt::format("{} in band ({:.3g} Hz)", mean_percent(score.in_band_percent_of_max), score.band);
}

/// All criteria, with what belongs to the one that logs can show.
std::vector<Criterion> criteria_of(const Validation& judged) {
  std::vector<Criterion> criteria = judged.criteria;
  criteria[static_cast<std::size_t>(&judged.prediction() - judged.criteria.data())].notes.push_back(
      fmt::format("worst: joint {}{}; mean of the joints {}, {} unfiltered", judged.worst_joint + 1,
                  judged.scores.size() > 1 ? " of " + judged.worst_log : "", mean_in_band(judged.all),
                  mean_percent(judged.all.percent_of_max)));
  return criteria;
}

/// Of the five criteria logs alone show one; a campaign judges the others.
std::vector<Criterion> shown(const Validation& judged) {
  const std::vector<Criterion> all = criteria_of(judged);
  return {all[static_cast<std::size_t>(&judged.prediction() - judged.criteria.data())]};
}

std::string consistency_in_words(const Validation& judged) {
  if (judged.physically_consistent) return " Every link is physically possible.";
  if (!model::has_physical_links(judged.robot)) return " At least one link is physically impossible.";
  return " Every link is physically possible, but at least one joint has negative friction or rotor inertia.";
}

/// What was judged.
std::string model_in_words(const Validation& judged) {
  const std::string& urdf = judged.urdf.empty() ? judged.robot.name : judged.urdf;
  std::string text = judged.model.empty() ? fmt::format("Model: the parameters of {}.", urdf)
                                          : fmt::format("Model: {}", judged.model);
  if (!judged.fit) {
    if (!judged.model.empty()) text += ".";
  } else if (judged.fit->base_parameters.empty()) {
    text += fmt::format(" ({}).", judged.fit->method);
  } else {
    const std::vector<model::BaseParameterRecord>& base = judged.fit->base_parameters;
    const auto determined = std::count_if(base.begin(), base.end(),
                                          [](const model::BaseParameterRecord& p) { return p.determined; });
    text +=
        fmt::format(" ({}, {} of {} base parameters determined, condition number {}).", judged.fit->method,
                    determined, base.size(), page::number(judged.fit->condition_number, 3));
  }
  return text + consistency_in_words(judged);
}

std::vector<std::string> paths_of(const Validation& judged) {
  std::vector<std::string> paths;
  for (const data::StreamSummary& log : judged.logs) paths.push_back(log.path);
  return paths;
}

/// The record of the fit, or what is known of parameters without one.
model::FitRecord record_of(const Validation& judged) {
  if (judged.fit) return *judged.fit;
  model::FitRecord record;
  record.condition_number = kNaN;
  record.physically_consistent = judged.physically_consistent;
  return record;
}

}  // namespace

std::string brief(const Validation& judged) {
  return fmt::format(
      "The model misses the measured torque by {:.3g} % of the joint's largest torque in the worst joint "
      "({}), {}.",
      judged.worst_percent, judged.worst_joint + 1,
      judged.all.band > 0 ? fmt::format("below {:.3g} Hz", judged.all.band) : "unfiltered");
}

std::string full(const Validation& judged) {
  std::string text =
      fmt::format("{}\n{}\n{}\n", brief(judged), verdict_text(judged.judgement), model_in_words(judged));
  for (const Score& score : judged.scores) {
    text += fmt::format("{}: {} samples\n{}", score.log, score.samples, validation_text(score));
  }
  if (judged.scores.size() > 1) {
    text += fmt::format("All {} logs together, {} samples\n{}", judged.scores.size(), judged.all.samples,
                        validation_text(judged.all));
  }
  text += fmt::format("{}\nResidual:\n", score_meaning(judged.all) + validation_meaning());
  for (int j = 0; j < judged.all.num_joints(); ++j) {
    text += fmt::format("  joint {}: {}\n", j + 1, validate::describe_residual(judged.all, j));
  }
  const std::vector<Criterion> criterion = shown(judged);
  return text + fmt::format("Acceptance (the criterion that logs can show):\n{}{}",
                            criteria_table(criterion).to_text(2), criteria_lines(criterion));
}

std::string json(const Validation& judged) {
  nlohmann::ordered_json json{{"robot", judged.robot.name},
                              {"model", judged.model},
                              {"torque_at", data::to_string(judged.torque_at)}};
  put_verdict(json, judged.judgement);
  json.update(validation_json(judged.all));
  json.update(fit_json(record_of(judged)));
  json["criteria"] = criteria_json(criteria_of(judged));
  json["logs"] = nlohmann::ordered_json::array();
  for (const Score& score : judged.scores) {
    nlohmann::ordered_json entry{{"log", score.log}};
    entry.update(validation_json(score));
    json["logs"].push_back(std::move(entry));
  }
  return text_of(json);
}

page::Page page(const Validation& judged) {
  page::Page page =
      page::new_page(fmt::format("{}: model judged", judged.robot.name), file_names_of(paths_of(judged)));
  for (const data::StreamSummary& log : judged.logs) add_log_line(page, log_line(log));
  page.verdict(brief(judged), judged.judgement);
  page.paragraph(model_in_words(judged));
  const std::vector<Criterion> criterion = shown(judged);
  page.table(criteria_table(criterion),
             "The acceptance criterion that logs can show; heft validate --campaign judges all five");
  add_criteria_notes(page, criterion);
  const std::string meaning = score_meaning(judged.all) + validation_meaning();
  for (std::size_t k = 0; k < judged.scores.size(); ++k) {
    page.heading(file_name_of(judged.scores[k].log));
    page.table(validation_table(judged.scores[k]), meaning + moving_line(judged.scores[k]));
    if (k < judged.traces.size()) {
      page.plots("Torque over time", small(torque_plots(judged.traces[k])));
      page.plots("Torque error over time", small(residual_plots(judged.traces[k])));
      page.file(residual_file(judged.traces[k], judged.scores[k].log));
    }
    add_residual_words(page, judged.scores[k]);
  }
  if (judged.fit && !judged.fit->base_parameters.empty())
    page.table(base_parameter_table(*judged.fit), "Base parameters of the fit");
  if (judged.fit) {
    for (const std::string& line : judged.fit->missing) page.note(line);
  }
  return page;
}

}  // namespace heft::report
