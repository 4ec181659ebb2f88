/// @file
/// A tracking comparison in words, as JSON, as a page; and runs of controllers side by side.
#pragma once

#include <string>
#include <vector>

#include "heft/page/page.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "heft/track/track.hpp"

namespace heft::report {

/// One sentence: the errors with the estimated load, with nominal values, of PD.
std::string brief(const track::Tracking& tracking);
/// What `heft track` prints: tables of errors, the load, the verdict.
std::string full(const track::Tracking& tracking);
/// Fields as tools/README.md names them.
std::string json(const track::Tracking& tracking);
page::Page page(const track::Tracking& tracking);

/// The same of several loads: a table a load.
std::string brief(const track::LoadComparison& comparison);
std::string full(const track::LoadComparison& comparison);
std::string json(const track::LoadComparison& comparison);
page::Page page(const track::LoadComparison& comparison);

/// Root mean square and largest tracking error per joint and controller, and of the tool.
page::Table tracking_table(const std::vector<track::Run>& runs);
/// One plot a joint: every controller's error over time.
std::vector<page::PlotSpec> tracking_plots(const std::vector<track::Run>& runs,
                                           const std::vector<page::Mark>& marks = {});
/// Bars: root mean square error per joint, one bar a controller.
page::PlotSpec tracking_bars(const std::vector<track::Run>& runs);
/// A list of JSON objects, one a controller: root mean square and largest error per joint.
std::string json(const std::vector<track::Run>& runs);

}  // namespace heft::report
