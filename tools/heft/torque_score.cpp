#include "torque_score.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/data/differentiate.hpp"

namespace heft::tools {
namespace {

constexpr double kEnd = 0.5;  ///< left out at either end [s]

double root_mean_square(const Eigen::VectorXd& values) {
  return values.size() == 0 ? std::numeric_limits<double>::quiet_NaN()
                            : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

/// Rows of the samples at least kEnd from both ends: first and count.
std::pair<Eigen::Index, Eigen::Index> inner_rows(const Eigen::VectorXd& time) {
  Eigen::Index first = 0;
  Eigen::Index last = time.size();
  while (first < last && time[first] < time[0] + kEnd) ++first;
  while (last > first && time[last - 1] > time[time.size() - 1] - kEnd) --last;
  return {first, last - first};
}

}  // namespace

TorqueScore score_torque(const data::Log& log, const Eigen::MatrixXd& predicted, double band) {
  TorqueScore score;
  const Eigen::Index n = predicted.cols();
  auto [first, count] = inner_rows(log.time);
  if (count < 2) {
    first = 0;
    count = log.time.size();
    score.ends_left_out = false;
  }
  const Eigen::MatrixXd residual = log.tau - predicted;
  score.rmse.resize(n);
  score.rmse_in_band.setConstant(n, std::numeric_limits<double>::quiet_NaN());
  score.percent_of_max.resize(n);
  score.r2.resize(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const Eigen::VectorXd e = residual.col(j).segment(first, count);
    const Eigen::VectorXd y = log.tau.col(j).segment(first, count);
    const double largest = log.tau.col(j).cwiseAbs().maxCoeff();
    const double variance = (y.array() - y.mean()).matrix().squaredNorm();
    score.rmse[j] = root_mean_square(e);
    score.percent_of_max[j] =
        largest > 0 ? 100.0 * score.rmse[j] / largest : std::numeric_limits<double>::quiet_NaN();
    score.r2[j] = variance > 0 ? 1.0 - e.squaredNorm() / variance : std::numeric_limits<double>::quiet_NaN();
  }

  constexpr Eigen::Index kFewestToFilter = 16;
  if (log.time.size() < kFewestToFilter) return score;
  // The filter needs an even grid. Filtering is linear, so the residual alone is filtered.
  data::Log even;
  even.time = log.time;
  even.q = log.q;
  even.tau = residual;
  even = data::resample_uniform(even);
  const double rate = data::median_sample_rate(even.time);
  score.band = band > 0 ? band : std::max(1.0, 5.0 * data::motion_bandwidth(even.q, rate));
  if (score.band >= 0.5 * rate) {
    score.band = 0.0;
    return score;
  }
  const Eigen::MatrixXd filtered = data::low_pass_zero_phase(even.tau, rate, score.band);
  auto [even_first, even_count] = inner_rows(even.time);
  if (even_count < 2) {
    even_first = 0;
    even_count = even.time.size();
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    score.rmse_in_band[j] = root_mean_square(filtered.col(j).segment(even_first, even_count));
  }
  return score;
}

std::string score_meaning(const TorqueScore& score) {
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

report::Table score_table(const TorqueScore& score) {
  report::Table table({"joint", "RMSE [N·m]", "in band [N·m]", "RMSE [% of max]", "R²"});
  for (Eigen::Index j = 0; j < score.rmse.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), report::number(score.rmse[j]),
                   report::number(score.rmse_in_band[j]), report::number(score.percent_of_max[j], 3),
                   std::isfinite(score.r2[j]) ? fmt::format("{:.3f}", score.r2[j]) : "–"});
  }
  return table;
}

nlohmann::ordered_json json_array(const Eigen::VectorXd& values) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const double value : values) {
    array.push_back(std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr));
  }
  return array;
}

nlohmann::ordered_json score_json(const TorqueScore& score) {
  nlohmann::ordered_json json;
  json["rmse"] = json_array(score.rmse);
  json["rmse_in_band"] = json_array(score.rmse_in_band);
  json["rmse_percent_of_max"] = json_array(score.percent_of_max);
  json["r2"] = json_array(score.r2);
  json["band_hz"] = score.band > 0 ? nlohmann::ordered_json(score.band) : nlohmann::ordered_json(nullptr);
  return json;
}

std::vector<report::PlotSpec> torque_plots(const data::Log& log, const Eigen::MatrixXd& predicted) {
  std::vector<report::PlotSpec> plots;
  for (Eigen::Index j = 0; j < predicted.cols(); ++j) {
    report::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "torque [N·m]";
    if (log.tau.cols() == predicted.cols()) {
      spec.series.push_back(report::line("measured", log.time, log.tau.col(j), report::Hue::kNeutral));
    }
    spec.series.push_back(report::line("model", log.time, predicted.col(j), report::Hue::kVermillion));
    plots.push_back(std::move(spec));
  }
  return plots;
}

}  // namespace heft::tools
