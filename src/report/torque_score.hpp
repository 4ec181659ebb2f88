/// @file
/// How well a predicted torque meets the measured one, as the contract of the JSON results defines it.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/data/log.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/model/model_file.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/score.hpp"
#include "page_lines.hpp"

namespace heft::report {

/// Scores a prediction that was made elsewhere, at the log's own time stamps.
/// @param predicted  samples × joints
/// @param band       low-pass cut-off [Hz]; 0 takes validate::default_band of the motion
/// @pre log.tau has as many columns as `predicted`
validate::Score score_torque(const data::Log& log, const Eigen::MatrixXd& predicted, double band);

/// A log as the end of a page states it.
LogLine log_line(const data::MotionStream& stream);
LogLine log_line(const data::Log& log, double low_pass = 0.0);

/// Says what the figures are; stands wherever they are printed.
std::string score_meaning(const validate::Score& score);
page::Table score_table(const validate::Score& score);
nlohmann::ordered_json score_json(const validate::Score& score);

/// The score with what a validation adds: 99.9 % quantile, bias, share of the residual that is no noise.
page::Table validation_table(const validate::Score& score);
/// Says what the further columns are, to stand behind score_meaning().
std::string validation_meaning();
/// The errors over the motion alone, where standstill at the ends makes them differ by more than 2 %; else empty.
/// Begins with a blank.
std::string moving_line(const validate::Score& score);
/// Table and line for the terminal.
std::string validation_text(const validate::Score& score);
nlohmann::ordered_json validation_json(const validate::Score& score);

/// Criteria: name, value, limit, verdict; and what the values are.
page::Table criteria_table(const std::vector<validate::Criterion>& criteria);
nlohmann::ordered_json criteria_json(const std::vector<validate::Criterion>& criteria);
/// "3 of 5 criteria met, 1 missed, 1 not judged".
std::string criteria_summary(const std::vector<validate::Criterion>& criteria);

/// Fields of the result that stand for a fit: base_parameters, condition_number, physically_consistent, missing.
nlohmann::ordered_json fit_json(const model::FitRecord& fit);
/// Base parameters with their intervals.
page::Table base_parameter_table(const model::FitRecord& fit);

/// Torque and residual of a long log, thinned while they come in: what the eye can see of them.
class TorqueTrace {
 public:
  /// @param samples  rows to come
  TorqueTrace(long samples, Eigen::Index joints);
  void add(const Eigen::VectorXd& time, const Eigen::MatrixXd& measured, const Eigen::MatrixXd& predicted);
  std::vector<page::PlotSpec> torque_plots() const;
  std::vector<page::PlotSpec> residual_plots() const;

 private:
  /// Smallest and largest values of a joint over some rows.
  struct Extremes {
    double low, high;
  };
  static void widen(Extremes& extremes, double value);
  std::vector<page::PlotSpec> plots(std::size_t first, std::size_t count, const std::string& y_label) const;

  long rows_a_step_;
  long rows_{0};
  std::vector<double> time_;  ///< where each step begins
  /// Per step, joint by joint: measured, predicted, residual.
  std::vector<std::vector<std::array<Extremes, 3>>> steps_;
  Eigen::Index joints_;
};

/// One plot a joint: predicted torque over time, with the measured one where the log has it.
std::vector<page::PlotSpec> torque_plots(const data::Log& log, const Eigen::MatrixXd& predicted);

/// Plots of which two stand side by side.
std::vector<page::PlotSpec> small(std::vector<page::PlotSpec> plots);

/// Entries of a vector as JSON; NaN is null.
nlohmann::ordered_json json_array(const Eigen::VectorXd& values);

}  // namespace heft::report
