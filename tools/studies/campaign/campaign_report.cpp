#include "campaign_report.hpp"

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/page/origin.hpp"
#include "heft/report/score.hpp"
#include "heft/report/verdict.hpp"
#include "host/json.hpp"

namespace heft::studies {
namespace {

std::string campaign_text(const CampaignSettings& settings, const CampaignResult& result) {
  std::string loads;
  for (const double payload : settings.payloads)
    loads += fmt::format("{}{:g}", loads.empty() ? "" : ", ", payload);
  return fmt::format(
      "Simulated arm: {} with the mass, centre of mass and central inertia of every link off by 10 to 25 %, "
      "and drives with rotor inertia, Coulomb and viscous friction and an offset. Forward dynamics by "
      "SUNDIALS, sticking friction, {:g} Hz, computed torque in the loop. Normally distributed noise, "
      "standard deviations: encoder {:g} rad (the loop closes on it too), torque {:g} N·m. "
      "Loads {} and {:g} kg; {} experiments of {:g} s without load that differ in noise. "
      "Seed {}: the arm and the exciting motion {}, the motion judged on {}, noise from {} on.",
      settings.nominal.name, settings.sample_rate, settings.position_noise, settings.torque_noise, loads,
      settings.judged_payload, settings.repeats, settings.duration, settings.seed, settings.seed,
      settings.seed + 1000, result.experiments.front().seed);
}

page::Table parameter_table(const CampaignResult& result) {
  page::Table table({"base parameter", "true", "found", "± (95 %)", "unit", "error [%]", "scatter [%]",
                     "torque share [%]", "counted"});
  for (int i = 0; i < result.fit.base.count(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    // A truth of 0 leaves nothing to be relative to.
    const double share = result.beta_true[i] == 0.0 ? kNaN : 100.0;
    const char* counted = result.counted.counted[at]  ? "yes"
                          : result.fit.determined[at] ? "no"
                                                      : "no: the log does not determine it";
    table.add_row({result.fit.base.name(*result.fit.columns, i), page::number(result.beta_true[i]),
                   page::number(result.fit.beta[i]), page::number(result.fit.half_width[i], 2),
                   (*result.fit.columns)[result.fit.base.kept[at]].unit,
                   page::number(share * result.errors[i], 3), page::number(share * result.scatter[i], 3),
                   page::number(100.0 * result.shares[i], 3), counted});
  }
  return table;
}

page::Table tracking_table(const CampaignResult& result) {
  std::vector<std::string> header{"computed torque with"};
  const Eigen::Index n = result.tracking.front().rms.size();
  for (Eigen::Index j = 0; j < n; ++j) header.push_back(fmt::format("joint {} [mrad]", j + 1));
  header.emplace_back("all [mrad]");
  page::Table table(header);
  for (const TrackingResult& tracking : result.tracking) {
    std::vector<std::string> row{tracking.name};
    for (const double rms : tracking.rms) row.push_back(page::number(1e3 * rms, 3));
    row.push_back(page::number(1e3 * tracking.total(), 3));
    table.add_row(row);
  }
  return table;
}

page::Table payload_table(const CampaignResult& result) {
  page::Table table({"identified with [kg]", "judged with [kg]", "worst joint, RMSE [% of max]",
                     "worst joint, in band [% of max]", "mean of the joints [% of max]"});
  for (const PayloadScore& entry : result.payloads) {
    table.add_row({fmt::format("{:g}", entry.trained), fmt::format("{:g}", entry.judged),
                   page::number(entry.score.percent_of_max.maxCoeff(), 3),
                   page::number(entry.score.in_band_percent_of_max.maxCoeff(), 3),
                   page::number(entry.score.percent_of_max.mean(), 3)});
  }
  return table;
}

nlohmann::ordered_json json_of(const CampaignSettings& settings, const CampaignResult& result) {
  nlohmann::ordered_json json{{"robot", settings.nominal.name},
                              {"seed", settings.seed},
                              {"sample_rate", settings.sample_rate},
                              {"duration", settings.duration},
                              {"position_noise_std", settings.position_noise},
                              {"torque_noise_std", settings.torque_noise},
                              {"payloads", settings.payloads},
                              {"repeats", settings.repeats},
                              {"criteria", as_json(report::json(result.criteria))}};
  json.update(as_json(report::json(result.holdout)));
  json.update(as_json(report::json(identify::fit_record(result.fit, "motor"))));
  for (Eigen::Index i = 0; i < result.errors.size(); ++i) {
    nlohmann::ordered_json& entry = json["base_parameters"][static_cast<std::size_t>(i)];
    entry["true"] = result.beta_true[i];
    entry["relative_error"] = result.errors[i];
    entry["scatter"] = host::number_or_null(result.scatter[i]);
    entry["torque_share"] = result.shares[i];
    entry["counted"] = static_cast<bool>(result.counted.counted[static_cast<std::size_t>(i)]);
  }
  json["payload_scores"] = nlohmann::ordered_json::array();
  for (const PayloadScore& entry : result.payloads) {
    json["payload_scores"].push_back(
        {{"identified_with", entry.trained},
         {"judged_with", entry.judged},
         {"rmse_percent_of_max", host::json_array(entry.score.percent_of_max)},
         {"rmse_in_band_percent_of_max", host::json_array(entry.score.in_band_percent_of_max)}});
  }
  json["load_difference"] = {{"value", result.load_difference},
                             {"std", result.load_difference_std},
                             {"true", result.load_difference_true}};
  json["tracking"] = nlohmann::ordered_json::array();
  for (const TrackingResult& tracking : result.tracking) {
    json["tracking"].push_back({{"model", tracking.name}, {"rms_error", host::json_array(tracking.rms)}});
  }
  json.update(as_json(report::verdict_json(result.judgement())));
  return json;
}

void add_plots(const CampaignResult& result, page::Page& page) {
  if (!result.trace) return;
  page.plots("Torque on the motion judged on", report::small(report::torque_plots(*result.trace)));
  page.plots("Torque error", report::small(report::residual_plots(*result.trace)));
  std::vector<page::PlotSpec> plots;
  for (Eigen::Index j = 0; j < result.tracking.front().rms.size(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "error [mrad]";
    for (std::size_t k = 0; k < 2; ++k) {
      const TrackingResult& tracking = result.tracking[k];
      spec.series.push_back(page::line(tracking.name, tracking.time, 1e3 * tracking.error.col(j),
                                       k == 0 ? page::Hue::kNeutral : page::Hue::kBlue));
    }
    plots.push_back(std::move(spec));
  }
  page.plots("Tracking error of computed torque", report::small(std::move(plots)));
}

/// Which parameters count for the first criterion.
std::string counted_meaning() {
  return fmt::format(
      "Parameters counted: base parameters that the log determined and that move at least {:g} % of a "
      "joint's torque on the motion judged on.",
      100.0 * identify::kCountedShare);
}

/// What the third criterion compares.
std::string tracking_meaning(const CampaignResult& result) {
  return fmt::format(
      "Tracking: the same loop on the motion judged on, against the true positions. "
      "\"{}\" has the URDF's links and the drives' catalogue values, as far off as the links; "
      "the criterion compares with it, since any model would win against the URDF alone, whose drives have "
      "neither friction nor rotors.",
      result.tracking.front().name);
}

std::string score_words(const CampaignResult& result) {
  return report::score_meaning(result.holdout) + report::validation_meaning();
}

std::string text_of(const CampaignSettings& settings, const CampaignResult& result) {
  std::string text =
      fmt::format("{}\n{}{}{}.\n{}", campaign_text(settings, result),
                  report::criteria_table(result.criteria).to_text(2), report::criteria_lines(result.criteria),
                  report::criteria_summary(result.criteria), report::verdict_text(result.judgement()));
  text += fmt::format("{}\nTorque on the motion judged on, without load:\n{}{}\n", counted_meaning(),
                      report::validation_text(result.holdout), score_words(result));
  text += fmt::format("Loads:\n{}", payload_table(result).to_text(2));
  return text + fmt::format("{}\n{}", tracking_meaning(result), tracking_table(result).to_text(2));
}

page::Page page_of(const CampaignSettings& settings, const CampaignResult& result) {
  page::Page page = page::new_page(fmt::format("{}: simulated campaign", settings.nominal.name),
                                   fmt::format("seed {}", settings.seed));
  page.verdict(report::criteria_summary(result.criteria) + ".", result.judgement());
  page.table(report::criteria_table(result.criteria), "Acceptance criteria");
  report::add_criteria_notes(page, result.criteria);
  page.paragraph(campaign_text(settings, result));
  page.paragraph(
      fmt::format("Condition number of the exciting motion's base regressor, unit columns: {:.3g}; of the "
                  "fit's weighted one: {:.3g}.",
                  result.condition, result.fit.condition));
  page.heading("Parameters");
  page.table(parameter_table(result), counted_meaning());
  page.heading("Torque");
  page.table(report::validation_table(result.holdout),
             score_words(result) + report::moving_line(result.holdout));
  report::add_residual_words(page, result.holdout);
  page.table(
      payload_table(result),
      fmt::format("Each model on the motion judged on, band {:.3g} Hz; in the last row the known difference "
                  "of the loads is added to the model",
                  result.holdout.band));
  page.heading("Tracking");
  page.table(tracking_table(result), tracking_meaning(result));
  add_plots(result, page);
  return page;
}

}  // namespace

StudyReport campaign_report(const CampaignSettings& settings, const CampaignResult& result) {
  return {page_of(settings, result), text_of(settings, result), {}, {}, {}, json_of(settings, result)};
}

}  // namespace heft::studies
