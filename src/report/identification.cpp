#include "heft/report/identification.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "heft/host/words.hpp"
#include "heft/model/physical_links.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using identify::Fit;
using identify::Identification;

std::string joined(const std::vector<int>& numbers) { return fmt::format("{}", fmt::join(numbers, ", ")); }

std::string consistency_in_words(const Fit& fit) {
  if (fit.physically_consistent) return "Every link is physically possible.";
  if (!model::has_physical_links(fit.robot))
    return "At least one link has physically impossible inertial parameters.";
  return "Every link is physically possible, but at least one joint has negative friction or rotor inertia.";
}

std::string physics_in_words(const Identification& found) {
  const Fit& fit = found.fit;
  std::string text = consistency_in_words(fit);
  const double loss = 100.0 * (std::sqrt(fit.physical_cost_ratio) - 1.0);
  text += fmt::format(" Constraining all links to be physical raises the weighted error by {:.2g} %", loss);
  if (!fit.at_boundary.empty()) {
    text += fmt::format("; at the edge of what is possible: link{} {}", fit.at_boundary.size() > 1 ? "s" : "",
                        joined(fit.at_boundary));
  }
  text += fit.method == identify::Method::kPhysical || fit.physically_consistent
              ? "."
              : " (--method physical takes them).";
  text += fmt::format(" Mass matrix not positive in {} of {} random poses (with rotor inertia: {}).",
                      found.mass.not_positive, found.mass.poses, found.mass.not_positive_with_rotors);
  if (!fit.repaired_prior.empty()) {
    text += fmt::format(
        " The URDF gives link{} {} an impossible inertia; the nearest physical one was used as the prior.",
        fit.repaired_prior.size() > 1 ? "s" : "", joined(fit.repaired_prior));
  }
  return text;
}

long determined(const Fit& fit) { return std::count(fit.determined.begin(), fit.determined.end(), true); }

/// What the fit is made of, without a full stop.
std::string summary(const Identification& found) {
  const Fit& fit = found.fit;
  return fmt::format(
      "{} base parameters, {} determined; {} samples of {} in {} rows; torque and regressor behind {:.3g} "
      "Hz; condition number {} (weighted base regressor, columns of norm 1){}; 95 % intervals from {} blocks "
      "of {:.2g} s",
      fit.base.count(), determined(fit), fit.samples,
      found.train_logs.size() == 1 ? "1 log" : fmt::format("{} logs", found.train_logs.size()),
      fit.rows.sum(), fit.cutoff, page::number(fit.condition, 3),
      fit.ridge ? ", steadied by a ridge towards the URDF" : "", fit.blocks, fit.block_length);
}

/// A model fitted to sums has no score on its own logs.
bool is_scored(const Identification& found) { return !found.train.empty() || !found.held_out.empty(); }

std::string meaning(const Identification& found) {
  return score_meaning(found.train.empty() ? found.held_out.front() : found.trained) + validation_meaning();
}

/// What the fit itself leaves of the torque, where nothing was scored.
std::string residual_in_words(const Identification& found) {
  const Fit& fit = found.fit;
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(fit.noise_std.size());
  for (const data::StreamSummary& log : found.train_logs) largest = largest.cwiseMax(log.max_torque);
  Eigen::Index joint = 0;
  const Eigen::VectorXd percent = 100.0 * fit.noise_std.cwiseQuotient(largest.cwiseMax(1e-300));
  const double worst = percent.maxCoeff(&joint);
  return fmt::format(
      "Behind the low-pass of {:.3g} Hz the fit leaves {:.2g} % of the joint's largest torque on average and {:.2g} % "
      "in the worst joint ({}); it was not judged on any log.",
      fit.cutoff, percent.mean(), worst, joint + 1);
}

std::string list(const std::string& title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string text = title + "\n";
  for (const std::string& line : lines) text += fmt::format("  {}\n", line);
  return text;
}

nlohmann::ordered_json bias_json(const identify::BiasTest& bias) {
  return {{"statistic", bias.statistic}, {"degrees_of_freedom", bias.degrees_of_freedom},
          {"p_value", bias.p_value},     {"torque_difference", bias.torque_difference},
          {"biased", bias.biased},       {"verdict", bias.verdict}};
}

void add_torque_plots(page::Page& page, const std::string& title, const validate::TorqueTrace& trace,
                      const std::string& log) {
  page.plots(title, small(torque_plots(trace)));
  page.plots("Residual", small(residual_plots(trace)));
  page.file(residual_file(trace, log));
}

void add_torque(page::Page& page, const Identification& found) {
  if (!is_scored(found)) return;
  page.heading("Torque");
  if (!found.train.empty())
    page.table(validation_table(found.trained), "Training. " + meaning(found) + moving_line(found.trained));
  for (std::size_t k = 0; k < found.held_out.size(); ++k) {
    const validate::Score& score = found.held_out[k];
    page.table(validation_table(score), "Held out: " + file_name_of(score.log) + "." + moving_line(score));
    if (k < found.held_out_traces.size())
      add_torque_plots(page, "Torque on the held-out log", found.held_out_traces[k], score.log);
  }
  if (!found.held_out.empty()) return;
  for (std::size_t k = 0; k < found.train_traces.size(); ++k) {
    add_torque_plots(page, "Torque on the training log", found.train_traces[k],
                     k < found.train_logs.size() ? found.train_logs[k].path : found.trained.log);
  }
}

}  // namespace

std::string brief(const Identification& found) {
  if (!is_scored(found)) return residual_in_words(found);
  const bool own = found.held_out.empty();
  const std::vector<validate::Score>& scores = own ? found.train : found.held_out;
  double worst = 0.0, mean = 0.0;
  Eigen::Index joint = 0;
  for (const validate::Score& score : scores) {
    Eigen::Index at = 0;
    const double percent = score.percent_of_max.maxCoeff(&at);
    if (percent > worst) worst = percent, joint = at;
    mean += score.percent_of_max.mean() / static_cast<double>(scores.size());
  }
  return fmt::format(
      "{} the model misses the torque by {:.2g} % of the joint's largest on average and by {:.2g} % in the "
      "worst joint ({}).",
      own ? "On its own training logs" : "On logs that it has not seen", mean, worst, joint + 1);
}

std::string full(const Identification& found) {
  std::string text = fmt::format("{}\n{}\n{}: {}.\n", brief(found), verdict_text(found.judgement),
                                 found.fit.robot.name, summary(found));
  if (!found.train.empty()) text += fmt::format("\nTraining\n{}", validation_text(found.trained));
  for (const validate::Score& score : found.held_out) {
    text += fmt::format("\nHeld out: {}, {} samples\n{}", score.log, score.samples, validation_text(score));
  }
  if (is_scored(found)) text += meaning(found) + " ";
  text += fmt::format("{}.\n\nBase parameters (* with others, see expression)\n{}", host::capital(found.how),
                      base_parameter_table(found.record()).to_text(2));
  text += fmt::format("\n{}\n", physics_in_words(found));
  if (found.fit.bias) text += fmt::format("Noise in the motion: {}\n", found.fit.bias->verdict);
  text += list("\nNot determined by these logs:", found.fit.missing);
  text += list("Notes:", found.fit.notes);
  return text;
}

std::string json(const Identification& found) {
  const Fit& fit = found.fit;
  nlohmann::ordered_json json{{"robot", fit.robot.name},
                              {"method", identify::to_string(fit.method)},
                              {"torque_at", data::to_string(found.torque_at)}};
  put_verdict(json, found.judgement);
  if (!found.train.empty()) json["train"] = validation_json(found.trained);
  // The judged figures come first where there are any: the error on logs not seen is the model's error.
  if (is_scored(found))
    json.update(validation_json(found.held_out.empty() ? found.trained : validate::pool(found.held_out)));
  json["judged_on"] = !is_scored(found) ? "nothing" : found.held_out.empty() ? "train" : "held_out";
  json["held_out"] = nlohmann::ordered_json::array();
  for (const validate::Score& score : found.held_out) {
    nlohmann::ordered_json entry{{"log", score.log}};
    entry.update(validation_json(score));
    json["held_out"].push_back(std::move(entry));
  }
  json.update(fit_json(found.record()));
  json["null_space"] = fit.base.null_space;
  json["condition_number_unscaled"] = fit.condition_unscaled;
  json["ridge"] = fit.ridge;
  json["mass_matrix_not_positive"] = {{"poses", found.mass.poses},
                                      {"links", found.mass.not_positive},
                                      {"with_rotors", found.mass.not_positive_with_rotors}};
  if (fit.bias) json["bias_test"] = bias_json(*fit.bias);
  json["notes"] = fit.notes;
  return text_of(json);
}

page::Page page(const Identification& found) {
  const Fit& fit = found.fit;
  page::Page page = page::new_page(
      fmt::format("{}: identified model", fit.robot.name),
      fmt::format("{} on {}", identify::to_string(fit.method), file_names_of(found.log_paths)));
  for (const auto* logs : {&found.train_logs, &found.judge_logs}) {
    for (const data::StreamSummary& log : *logs) add_log_line(page, log_line(log));
  }
  page.verdict(brief(found), found.judgement);
  std::vector<page::Fact> facts{
      {"base parameters", fmt::format("{}", fit.base.count()), fmt::format("{} determined", determined(fit))},
      {"condition number", page::number(fit.condition, 3), "weighted, columns of norm 1"},
      {"physical", fit.physically_consistent ? "yes" : "no",
       "every link physically possible, no negative friction"}};
  if (is_scored(found)) {
    const validate::Score& judged = found.held_out.empty() ? found.trained : found.held_out.front();
    facts.push_back({"mean R²", fmt::format("{:.3f}", judged.r2.mean()),
                     found.held_out.empty() ? "training" : "held out"});
  }
  page.facts(facts);
  page.paragraph(summary(found) + ".");
  page.paragraph(physics_in_words(found));
  if (fit.bias) page.note("Noise in the motion: " + fit.bias->verdict);
  add_torque(page, found);
  page.heading("Parameters");
  page.table(base_parameter_table(found.record()),
             "Base parameters with 95 % intervals for residuals correlated in time");
  if (!fit.missing.empty()) {
    page.heading("Parameters that these logs do not determine");
    for (const std::string& line : fit.missing) page.note(line);
  }
  page.heading("Parameters that no motion of this arm can reveal");
  page.preformatted(fmt::format("{}", fmt::join(fit.base.null_space, "\n")));
  for (const std::string& line : fit.notes) page.note(line);
  return page;
}

std::string urdf_notes(const std::vector<std::string>& notes) {
  std::string text = notes.empty() ? "" : "Notes on the URDF:\n";
  for (const std::string& note : notes) text += fmt::format("  {}\n", note);
  return text;
}

}  // namespace heft::report
