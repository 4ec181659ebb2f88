#include "tracking_runs.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

Eigen::VectorXd root_mean_squares(const Eigen::MatrixXd& error) {
  return (error.colwise().squaredNorm().transpose() /
          static_cast<double>(std::max<Eigen::Index>(1, error.rows())))
      .cwiseSqrt();
}

}  // namespace

std::vector<std::string> joint_names(Eigen::Index count) {
  std::vector<std::string> names;
  for (Eigen::Index j = 0; j < count; ++j) names.push_back(fmt::format("joint {}", j + 1));
  return names;
}

std::vector<double> to_vector(const Eigen::VectorXd& values) { return {values.begin(), values.end()}; }

page::Table tracking_table(const std::vector<track::Run>& runs) {
  std::vector<std::string> headers{"controller"};
  const Eigen::Index n = runs.empty() ? 0 : runs.front().error.cols();
  for (Eigen::Index j = 0; j < n; ++j) headers.push_back(fmt::format("joint {} [mrad]", j + 1));
  headers.push_back("largest [mrad]");
  const bool tool = !runs.empty() && runs.front().tool_error.size() > 0;
  if (tool) headers.insert(headers.end(), {"tool [mm]", "tool, largest [mm]"});
  page::Table table(headers);
  for (const track::Run& run : runs) {
    std::vector<std::string> row{run.name};
    const Eigen::VectorXd rms = root_mean_squares(run.error);
    for (const double value : rms) row.push_back(page::number(1e3 * value, 3));
    row.push_back(page::number(1e3 * run.peak(), 3));
    if (tool) {
      row.push_back(page::number(1e3 * run.tool_rms(), 3));
      row.push_back(page::number(1e3 * run.tool_peak(), 3));
    }
    table.add_row(row);
  }
  return table;
}

nlohmann::ordered_json tracking_json(const std::vector<track::Run>& runs) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const track::Run& run : runs) {
    json.push_back({{"controller", run.name},
                    {"rms_error", host::json_array(root_mean_squares(run.error))},
                    {"max_error", host::json_array(run.error.cwiseAbs().colwise().maxCoeff().transpose())}});
    if (run.tool_error.size() == 0) continue;
    json.back()["tool_rms_error"] = run.tool_rms();
    json.back()["tool_max_error"] = run.tool_peak();
  }
  return json;
}

std::string wrong_sentence(const std::optional<track::WrongModel>& wrong) {
  if (!wrong) return "";
  return fmt::format(
      "The controllers' arm is wrong: masses, centres of mass and friction by {:.3g} to {:.3g} % each, drawn with seed {}. "
      "\"Identified\" has the arm without these errors, \"arm estimated\" finds links, friction and load on the way.",
      100 * wrong->least, 100 * wrong->most, wrong->seed);
}

void put_wrong(nlohmann::ordered_json& json, const std::optional<track::WrongModel>& wrong) {
  if (!wrong) return;
  json["wrong_model"] = {{"least", wrong->least}, {"most", wrong->most}, {"seed", wrong->seed}};
}

std::string json(const std::vector<track::Run>& runs) { return text_of(tracking_json(runs)); }

std::vector<page::PlotSpec> tracking_plots(const std::vector<track::Run>& runs,
                                           const std::vector<page::Mark>& marks) {
  std::vector<page::PlotSpec> plots;
  const Eigen::Index n = runs.empty() ? 0 : runs.front().error.cols();
  for (Eigen::Index j = 0; j < n; ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = "error [mrad]";
    for (const track::Run& run : runs) {
      spec.series.push_back(page::line(run.name, run.time, 1e3 * run.error.col(j)));
    }
    spec.marks = marks;
    plots.push_back(std::move(spec));
  }
  return plots;
}

page::PlotSpec tracking_bars(const std::vector<track::Run>& runs) {
  page::PlotSpec spec;
  spec.title = "Tracking error per joint";
  spec.y_label = "RMS error [mrad]";
  for (const track::Run& run : runs) {
    spec.series.push_back(page::bars(run.name, to_vector(1e3 * root_mean_squares(run.error))));
  }
  spec.categories = joint_names(runs.empty() ? 0 : runs.front().error.cols());
  return spec;
}

}  // namespace heft::report
