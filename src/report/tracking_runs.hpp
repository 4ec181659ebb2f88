/// @file
/// Tables, plots and JSON of controllers' runs side by side.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "heft/track/track.hpp"

namespace heft::report {

using TrackingRun = track::Run;

/// Root mean square and largest tracking error per joint and controller.
page::Table tracking_table(const std::vector<TrackingRun>& runs);
nlohmann::ordered_json tracking_json(const std::vector<TrackingRun>& runs);
/// One plot a joint: every controller's error over time.
std::vector<page::PlotSpec> tracking_plots(const std::vector<TrackingRun>& runs,
                                           const std::vector<page::Mark>& marks = {});
/// Bars: root mean square error per joint, one bar a controller.
page::PlotSpec tracking_bars(const std::vector<TrackingRun>& runs);

/// "joint 1", "joint 2", ...: categories of bars.
std::vector<std::string> joint_names(Eigen::Index count);
/// Heights of bars.
std::vector<double> to_vector(const Eigen::VectorXd& values);

}  // namespace heft::report
