/// @file
/// How well a predicted torque meets the measured one, as tools/README.md defines it.
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
#include "heft/validate/torque_trace.hpp"
#include "page_lines.hpp"

namespace heft::report {

/// A log as the end of a page states it.
LogLine log_line(const data::StreamSummary& summary);
LogLine log_line(const data::Log& log, double low_pass = 0.0);

/// Says what the figures are; printed wherever they are.
std::string score_meaning(const validate::Score& score);
page::Table score_table(const validate::Score& score);
nlohmann::ordered_json score_json(const validate::Score& score);

/// The score with what a validation adds: 99.9 % quantile, bias, share of the residual that is no noise.
page::Table validation_table(const validate::Score& score);
/// Says what the further columns are, printed after score_meaning().
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
/// Their notes, one line each, for the terminal and for a page.
std::string criteria_lines(const std::vector<validate::Criterion>& criteria);
void add_criteria_notes(page::Page& page, const std::vector<validate::Criterion>& criteria);
/// A table that says of each joint what its residual is.
void add_residual_words(page::Page& page, const validate::Score& score);
/// "3 of 5 criteria met, 1 missed, 1 not judged".
std::string criteria_summary(const std::vector<validate::Criterion>& criteria);

/// Fields of the result that describe a fit: base_parameters, condition_number, physically_consistent, missing.
nlohmann::ordered_json fit_json(const model::FitRecord& fit);
/// Base parameters with their intervals.
page::Table base_parameter_table(const model::FitRecord& fit);

/// Measured and predicted torque over time, one plot a joint.
std::vector<page::PlotSpec> torque_plots(const validate::TorqueTrace& trace);
/// Measured minus predicted.
std::vector<page::PlotSpec> residual_plots(const validate::TorqueTrace& trace);

/// One plot a joint: predicted torque over time, with the measured one where the log has it.
std::vector<page::PlotSpec> torque_plots(const data::Log& log, const Eigen::MatrixXd& predicted);

/// Plots, two side by side.
std::vector<page::PlotSpec> small(std::vector<page::PlotSpec> plots);

}  // namespace heft::report
