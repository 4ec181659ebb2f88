/// @file
/// How well a predicted torque meets the measured one, as tools/README.md defines it, and what a fit found: the words,
/// tables, JSON and plots that several answers share, for programs that put together an answer of their own.
#pragma once

#include <string>
#include <vector>

#include "heft/model/model_file.hpp"
#include "heft/page/page.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/score.hpp"
#include "heft/validate/torque_trace.hpp"

namespace heft::report {

/// Says what the figures are; printed wherever they are.
std::string score_meaning(const validate::Score& score);
/// The score with what a validation adds: 99.9 % quantile, bias, share of the residual that is no noise.
page::Table validation_table(const validate::Score& score);
/// Says what the further columns are, printed after score_meaning().
std::string validation_meaning();
/// The errors over the motion alone, where standstill at the ends makes them differ by more than 2 %; else empty.
/// Begins with a blank.
std::string moving_line(const validate::Score& score);
/// Table and line for the terminal.
std::string validation_text(const validate::Score& score);
/// A table that says of each joint what its residual is.
void add_residual_words(page::Page& page, const validate::Score& score);
/// One JSON object with all figures of the score.
std::string json(const validate::Score& score);

/// "3 of 5 criteria met, 1 missed, 1 not judged".
std::string criteria_summary(const std::vector<validate::Criterion>& criteria);
/// Name, value, limit, verdict; and what the values are.
page::Table criteria_table(const std::vector<validate::Criterion>& criteria);
/// Their notes, one line each, for the terminal and for a page.
std::string criteria_lines(const std::vector<validate::Criterion>& criteria);
void add_criteria_notes(page::Page& page, const std::vector<validate::Criterion>& criteria);
/// A list of JSON objects.
std::string json(const std::vector<validate::Criterion>& criteria);

/// Base parameters with their intervals.
page::Table base_parameter_table(const model::FitRecord& fit);
/// One JSON object: base_parameters, condition_number, physically_consistent, missing.
std::string json(const model::FitRecord& fit);

/// Measured and predicted torque over time, one plot a joint.
std::vector<page::PlotSpec> torque_plots(const validate::TorqueTrace& trace);
/// Measured minus predicted.
std::vector<page::PlotSpec> residual_plots(const validate::TorqueTrace& trace);
/// Measured minus predicted as a file that the page carries: means of as many samples as the trace's steps have.
/// @param log  named in the file
page::DataFile residual_file(const validate::TorqueTrace& trace, const std::string& log);
/// Plots of the size that goes two side by side.
std::vector<page::PlotSpec> small(std::vector<page::PlotSpec> plots);

}  // namespace heft::report
