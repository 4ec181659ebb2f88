#include "heft/report/dynamics.hpp"

#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "host/json.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using validate::DynamicsQuantity;
using validate::InverseDynamics;
using validate::LogDynamics;

std::string subject_of(const InverseDynamics& dynamics) {
  switch (dynamics.what) {
    case DynamicsQuantity::kGravity: return "gravity torque";
    case DynamicsQuantity::kRegressor: return "regressor";
    case DynamicsQuantity::kTorque: break;
  }
  return dynamics.torque_at == data::TorqueAt::kMotor ? "torque with rotor inertia and friction"
                                                      : "torque of the rigid bodies";
}

/// "1 row", "7 rows".
std::string counted(long count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// One plot a joint: predicted torque over time, with the measured one where the log has it.
std::vector<page::PlotSpec> dynamics_plots(const data::Log& log, const Eigen::MatrixXd& predicted) {
  std::vector<page::PlotSpec> plots;
  for (Eigen::Index j = 0; j < predicted.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "torque [N·m]";
    if (log.tau.cols() == predicted.cols()) {
      spec.series.push_back(page::line("measured", log.time, log.tau.col(j), page::Hue::kNeutral));
    }
    spec.series.push_back(page::line("model", log.time, predicted.col(j), page::Hue::kVermillion));
    plots.push_back(std::move(spec));
  }
  return plots;
}

void add_log(page::Page& page, const InverseDynamics& dynamics, const LogDynamics& one) {
  page.heading(one.log.path);
  if (dynamics.what == DynamicsQuantity::kRegressor) {
    page.paragraph(
        fmt::format("Regressor with {} columns a joint.", dynamics.columns.size() / one.log.num_joints()));
    return;
  }
  if (one.score) {
    page.verdict(
        fmt::format("The model meets the measured torque within {} % of each joint's largest torque.",
                    page::number(one.score->percent_of_max.maxCoeff(), 2)));
    page.table(score_table(*one.score), score_meaning(*one.score));
  } else {
    page.verdict(
        fmt::format("Largest {}: {} N·m.", subject_of(dynamics), page::number(one.largest().maxCoeff())));
  }
  page.plots("Torque over time", dynamics_plots(one.log, one.values));
}

}  // namespace

std::string brief(const InverseDynamics& dynamics) {
  long rows = 0;
  for (const LogDynamics& one : dynamics.logs) rows += one.log.num_samples();
  return fmt::format("{}: {} for {} of {}.", dynamics.robot, subject_of(dynamics), counted(rows, "row"),
                     counted(static_cast<long>(dynamics.logs.size()), "log"));
}

std::string full(const InverseDynamics& dynamics) {
  std::string text;
  for (const LogDynamics& one : dynamics.logs) {
    text += fmt::format("{}: {} of {} for {}\n", one.log.path, subject_of(dynamics), dynamics.robot,
                        counted(one.log.num_samples(), "row"));
    if (!one.score) continue;
    text += fmt::format("Against the torque that the log holds:\n{}{}\n", score_table(*one.score).to_text(2),
                        score_meaning(*one.score));
  }
  return text;
}

std::string json(const InverseDynamics& dynamics) {
  nlohmann::ordered_json json{{"robot", dynamics.robot},
                              {"what", to_string(dynamics.what)},
                              {"torque_at", data::to_string(dynamics.torque_at)}};
  json["logs"] = nlohmann::ordered_json::array();
  for (const LogDynamics& one : dynamics.logs) {
    nlohmann::ordered_json entry{{"log", one.log.path}, {"samples", one.log.num_samples()}};
    if (dynamics.what != DynamicsQuantity::kRegressor) entry["max_abs"] = host::json_array(one.largest());
    if (one.score) entry.update(score_json(*one.score));
    json["logs"].push_back(std::move(entry));
  }
  return text_of(json);
}

page::Page page(const InverseDynamics& dynamics) {
  page::Page page = page::new_page(fmt::format("{}: {}", dynamics.robot, subject_of(dynamics)),
                                   counted(static_cast<long>(dynamics.logs.size()), "log"));
  for (const LogDynamics& one : dynamics.logs) add_log(page, dynamics, one);
  return page;
}

std::string csv(const InverseDynamics& dynamics) {
  const bool several = dynamics.logs.size() > 1;
  std::string csv = several ? "log,time" : "time";
  for (const std::string& column : dynamics.columns) csv += "," + column;
  csv += '\n';
  for (std::size_t k = 0; k < dynamics.logs.size(); ++k) {
    const LogDynamics& one = dynamics.logs[k];
    for (Eigen::Index row = 0; row < one.values.rows(); ++row) {
      if (several) csv += fmt::format("{},", k + 1);
      csv += fmt::format("{}", one.log.time[row]);
      for (const double value : one.values.row(row))
        csv += fmt::format(",{}", value == 0.0 ? 0.0 : value);  // no "-0"
      csv += '\n';
    }
  }
  return csv;
}

}  // namespace heft::report
