/// @file
/// How well a predicted torque meets the measured one, as the contract of the JSON results defines it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/data/log.hpp"
#include "heft/report/plot.hpp"
#include "heft/report/table.hpp"

namespace heft::tools {

/// Per joint; vectors of n.
struct TorqueScore {
  Eigen::VectorXd rmse;  ///< measured (unfiltered) minus predicted, without the first and last 0.5 s [N·m, N]
  Eigen::VectorXd rmse_in_band;    ///< both through the same zero-phase low-pass at `band` [N·m, N]
  Eigen::VectorXd percent_of_max;  ///< rmse against the largest absolute measured torque of the log
  Eigen::VectorXd r2;              ///< 1 - residual / variance of the measured torque, same samples as rmse
  double band{0.0};          ///< [Hz]; 0: no band-limited figure, the log is too short or too slow for it
  bool ends_left_out{true};  ///< false when the log is too short to leave out its ends
};

/// @param predicted  samples × joints, at the log's time stamps
/// @param band       low-pass cut-off [Hz]; 0 takes five times the motion's bandwidth
/// @pre log.tau has as many columns as `predicted`
TorqueScore score_torque(const data::Log& log, const Eigen::MatrixXd& predicted, double band);

/// Says what the figures are; stands wherever they are printed.
std::string score_meaning(const TorqueScore& score);
report::Table score_table(const TorqueScore& score);
nlohmann::ordered_json score_json(const TorqueScore& score);

/// One plot a joint: predicted torque over time, with the measured one where the log has it.
std::vector<report::PlotSpec> torque_plots(const data::Log& log, const Eigen::MatrixXd& predicted);

/// Entries of a vector as JSON; NaN is null.
nlohmann::ordered_json json_array(const Eigen::VectorXd& values);

}  // namespace heft::tools
