#include "torque_score.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "host/json.hpp"

namespace heft::report {

LogLine log_line(const data::StreamSummary& summary) {
  return {summary.path, summary.sample_rate, summary.end - summary.begin, summary.cutoff};
}

LogLine log_line(const data::Log& log, double low_pass) {
  const Eigen::Index rows = log.time.size();
  const double seconds = rows > 1 ? log.time[rows - 1] - log.time[0] : 0.0;
  return {log.path, seconds > 0.0 ? static_cast<double>(rows - 1) / seconds : 0.0, seconds, low_pass};
}

std::string score_meaning(const validate::Score& score) {
  std::string text = "RMSE: measured torque as logged, unfiltered, minus the prediction; ";
  text += score.ends_left_out ? "all samples but the first and last 0.5 s."
                              : "all samples (the log is too short to leave out its ends).";
  if (score.band > 0) {
    text += fmt::format(" In band: both through the same zero-phase low-pass, {:.3g} Hz.", score.band);
  } else {
    text += " In band: none, the log is too short or too slowly sampled for its motion.";
  }
  return text;
}

page::Table score_table(const validate::Score& score) {
  page::Table table({"joint", "RMSE [N·m]", "in band [N·m]", "RMSE [% of max]", "R²"});
  for (Eigen::Index j = 0; j < score.rmse.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), page::number(score.rmse[j]), page::number(score.rmse_in_band[j]),
                   page::number(score.percent_of_max[j], 3),
                   std::isfinite(score.r2[j]) ? fmt::format("{:.3f}", score.r2[j]) : "–"});
  }
  return table;
}

nlohmann::ordered_json score_json(const validate::Score& score) {
  nlohmann::ordered_json json;
  json["rmse"] = host::json_array(score.rmse);
  json["rmse_in_band"] = host::json_array(score.rmse_in_band);
  json["rmse_percent_of_max"] = host::json_array(score.percent_of_max);
  json["r2"] = host::json_array(score.r2);
  json["band_hz"] = score.band > 0 ? nlohmann::ordered_json(score.band) : nlohmann::ordered_json(nullptr);
  return json;
}

page::Table validation_table(const validate::Score& score) {
  page::Table table({"joint", "RMSE [N·m]", "in band [N·m]", "RMSE [% of max]", "in band [% of max]", "R²",
                     "99.9 % below [N·m]", "bias [N·m]", "structured share [%]", "within [Hz]"});
  for (Eigen::Index j = 0; j < score.rmse.size(); ++j) {
    table.add_row(
        {fmt::format("{}", j + 1), page::number(score.rmse[j], 3), page::number(score.rmse_in_band[j], 3),
         page::number(score.percent_of_max[j], 3), page::number(score.in_band_percent_of_max[j], 3),
         std::isfinite(score.r2[j]) ? fmt::format("{:.4f}", score.r2[j]) : "–",
         page::number(score.quantile_999[j], 3), page::number(score.bias[j], 2),
         page::number(100.0 * score.correlated_share[j], 2), page::number(score.correlated_below[j], 2)});
  }
  return table;
}

std::string validation_meaning() {
  return " Bias: mean of measured minus predicted. Structured share: share of the residual's variance that "
         "is correlated in time, nine tenths of it below the frequency given.";
}

std::string moving_line(const validate::Score& score) {
  const auto differs = [](const Eigen::VectorXd& moving, const Eigen::VectorXd& all) {
    constexpr double kWorthALine = 0.02;
    return ((moving - all).cwiseAbs().array() > (kWorthALine * all).array()).any();
  };
  if (!differs(score.rmse_moving, score.rmse) && !differs(score.rmse_in_band_moving, score.rmse_in_band))
    return "";
  const auto list = [](const Eigen::VectorXd& values) {
    std::string text;
    for (const double value : values) text += (text.empty() ? "" : ", ") + page::number(value, 3);
    return text;
  };
  std::string text = " Over the motion alone, standstill at the ends cut: RMSE " + list(score.rmse_moving);
  if (score.band > 0) text += "; in band " + list(score.rmse_in_band_moving);
  return text + " N·m.";
}

std::string validation_text(const validate::Score& score) {
  const std::string line = moving_line(score);
  return validation_table(score).to_text(2) + (line.empty() ? "" : " " + line + "\n");
}

nlohmann::ordered_json validation_json(const validate::Score& score) {
  nlohmann::ordered_json json = score_json(score);
  json["rmse_moving"] = host::json_array(score.rmse_moving);
  json["rmse_in_band_moving"] = host::json_array(score.rmse_in_band_moving);
  json["rmse_in_band_percent_of_max"] = host::json_array(score.in_band_percent_of_max);
  json["max_torque"] = host::json_array(score.max_torque);
  json["quantile_999"] = host::json_array(score.quantile_999);
  json["bias"] = host::json_array(score.bias);
  json["samples"] = score.samples;
  json["whiteness"] = {{"correlated_share", host::json_array(score.correlated_share)},
                       {"correlated_below_hz", host::json_array(score.correlated_below)},
                       {"correlation_time", host::json_array(score.correlation_time)}};
  json["whiteness"]["verdict"] = nlohmann::ordered_json::array();
  for (int j = 0; j < score.num_joints(); ++j) {
    json["whiteness"]["verdict"].push_back(validate::describe_residual(score, j));
  }
  return json;
}

page::Table criteria_table(const std::vector<validate::Criterion>& criteria) {
  page::Table table({"criterion", "value [%]", "limit [%]", "verdict", "what the value is"});
  for (const validate::Criterion& criterion : criteria) {
    table.add_row({criterion.name, page::number(criterion.value, 3),
                   fmt::format("{} {:g}", criterion.at_least ? ">" : "<", criterion.limit),
                   to_string(criterion.verdict), criterion.meaning});
  }
  return table;
}

nlohmann::ordered_json criteria_json(const std::vector<validate::Criterion>& criteria) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const validate::Criterion& criterion : criteria) {
    json.push_back({{"id", criterion.id},
                    {"name", criterion.name},
                    {"value_percent", std::isfinite(criterion.value) ? nlohmann::ordered_json(criterion.value)
                                                                     : nlohmann::ordered_json(nullptr)},
                    {"limit_percent", criterion.limit},
                    {"at_least", criterion.at_least},
                    {"verdict", to_string(criterion.verdict)},
                    {"meaning", criterion.meaning},
                    {"notes", criterion.notes}});
  }
  return json;
}

std::string criteria_lines(const std::vector<validate::Criterion>& criteria) {
  std::string text;
  for (const validate::Criterion& criterion : criteria) {
    for (const std::string& line : criterion.notes) text += fmt::format("  {}: {}\n", criterion.name, line);
  }
  return text;
}

void add_criteria_notes(page::Page& page, const std::vector<validate::Criterion>& criteria) {
  for (const validate::Criterion& criterion : criteria) {
    for (const std::string& line : criterion.notes) page.note(fmt::format("{}: {}", criterion.name, line));
  }
}

void add_residual_words(page::Page& page, const validate::Score& score) {
  page::Table table({"joint", "residual"});
  for (int j = 0; j < score.num_joints(); ++j) {
    table.add_row({fmt::format("{}", j + 1), validate::describe_residual(score, j)});
  }
  page.table(table, "Residual: noise or model error");
}

std::string criteria_summary(const std::vector<validate::Criterion>& criteria) {
  const auto count = [&](validate::Verdict verdict) {
    return std::count_if(criteria.begin(), criteria.end(),
                         [verdict](const validate::Criterion& c) { return c.verdict == verdict; });
  };
  const auto missed = count(validate::Verdict::kMissed), open = count(validate::Verdict::kNotJudged);
  std::string text = fmt::format("{} of {} criteria met", count(validate::Verdict::kMet), criteria.size());
  if (missed > 0) text += fmt::format(", {} missed", missed);
  if (open > 0) text += fmt::format(", {} not judged", open);
  return text;
}

nlohmann::ordered_json fit_json(const model::FitRecord& fit) {
  const auto number = host::number_or_null;
  nlohmann::ordered_json json;
  json["base_parameters"] = nlohmann::ordered_json::array();
  for (const model::BaseParameterRecord& parameter : fit.base_parameters) {
    json["base_parameters"].push_back({{"name", parameter.name},
                                       {"unit", parameter.unit},
                                       {"expression", parameter.expression},
                                       {"value", parameter.value},
                                       {"std", number(parameter.std)},
                                       {"half_width_95", number(parameter.half_width)},
                                       {"determined", parameter.determined}});
  }
  json["condition_number"] = number(fit.condition_number);
  json["physically_consistent"] = fit.physically_consistent;
  json["physical_cost_ratio"] = number(fit.physical_cost_ratio);
  json["missing"] = fit.missing;
  return json;
}

std::string json(const validate::Score& score) { return text_of(validation_json(score)); }
std::string json(const std::vector<validate::Criterion>& criteria) {
  return text_of(criteria_json(criteria));
}
std::string json(const model::FitRecord& fit) { return text_of(fit_json(fit)); }

page::Table base_parameter_table(const model::FitRecord& fit) {
  page::Table table({"base parameter", "value", "± (95 %)", "unit", "", "combination"});
  for (const model::BaseParameterRecord& parameter : fit.base_parameters) {
    table.add_row({parameter.name, page::number(parameter.value), page::number(parameter.half_width, 2),
                   parameter.unit, parameter.determined ? "" : "not determined", parameter.expression});
  }
  return table;
}

namespace {

/// One curve of a trace.
struct Curve {
  const char* label;
  page::Hue hue;
  validate::TorqueTrace::Extremes validate::TorqueTrace::Step::*extremes;
};

std::vector<page::PlotSpec> plots_of(const validate::TorqueTrace& trace, const std::vector<Curve>& curves,
                                     const std::string& y_label) {
  std::vector<page::PlotSpec> specs;
  for (std::size_t j = 0; j < static_cast<std::size_t>(trace.num_joints()); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = y_label;
    for (const Curve& curve : curves) {
      page::Series series;
      series.label = curve.label;
      series.hue = curve.hue;
      for (std::size_t k = 0; k < trace.time().size(); ++k) {
        const validate::TorqueTrace::Extremes& extremes = trace.steps()[k][j].*curve.extremes;
        series.x.push_back(trace.time()[k]);
        series.y.push_back(extremes.low);
        if (trace.rows_a_step() == 1) continue;
        series.x.push_back(trace.time()[k]);
        series.y.push_back(extremes.high);
      }
      spec.series.push_back(std::move(series));
    }
    specs.push_back(std::move(spec));
  }
  return specs;
}

}  // namespace

std::vector<page::PlotSpec> torque_plots(const validate::TorqueTrace& trace) {
  return plots_of(trace,
                  {{"measured", page::Hue::kNeutral, &validate::TorqueTrace::Step::measured},
                   {"model", page::Hue::kVermillion, &validate::TorqueTrace::Step::predicted}},
                  "torque [N·m]");
}

std::vector<page::PlotSpec> residual_plots(const validate::TorqueTrace& trace) {
  return plots_of(trace, {{"measured − model", page::Hue::kBlue, &validate::TorqueTrace::Step::residual}},
                  "torque error [N·m]");
}

page::DataFile residual_file(const validate::TorqueTrace& trace, const std::string& log) {
  page::DataFile file = residual_file(log, trace.rows_a_step());
  file.columns.push_back({"time", trace.time()});
  for (std::size_t j = 0; j < static_cast<std::size_t>(trace.num_joints()); ++j) {
    file.columns.push_back({fmt::format("residual{}", j + 1), {}});
    for (const std::vector<validate::TorqueTrace::Step>& step : trace.steps())
      file.columns.back().values.push_back(step[j].residual_mean);
  }
  return file;
}

std::vector<page::PlotSpec> small(std::vector<page::PlotSpec> plots) {
  for (page::PlotSpec& plot : plots) {
    plot.width = 460;
    plot.height = 220;
  }
  return plots;
}

}  // namespace heft::report
