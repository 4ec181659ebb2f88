#include "heft/report/simulation.hpp"

#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using sim::Simulation;
using sim::SimulationEvent;

page::Table joint_table(const Simulation& simulation) {
  const Eigen::VectorXd error = simulation.tracking_error(), torque = simulation.largest_torque();
  page::Table table({"joint", "RMS tracking error [rad, m]", "largest torque [N·m, N]"});
  for (int j = 0; j < simulation.result.log.num_joints(); ++j) {
    table.add_row({fmt::format("{}", j + 1), error.size() > 0 ? page::number(error[j]) : "–",
                   torque.size() > 0 ? page::number(torque[j]) : "–"});
  }
  return table;
}

/// A plot a joint of one channel, with its reference where there is one and the payload events as marks.
std::vector<page::PlotSpec> channel_plots(const Simulation& simulation, const Eigen::MatrixXd& channel,
                                          const Eigen::MatrixXd& reference, const std::string& label) {
  std::vector<page::PlotSpec> plots;
  const Eigen::VectorXd& time = simulation.result.log.time;
  for (Eigen::Index j = 0; j < channel.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = label;
    const bool has_reference = reference.cols() == channel.cols();
    if (has_reference)
      spec.series.push_back(page::line("reference", time, reference.col(j), page::Hue::kNeutral));
    spec.series.push_back(
        page::line(has_reference ? "measured" : "", time, channel.col(j), page::Hue::kBlue));
    for (const SimulationEvent& event : simulation.payload_events())
      spec.marks.push_back({page::Mark::Direction::kVertical, event.time, to_string(event.kind)});
    plots.push_back(std::move(spec));
  }
  return plots;
}

}  // namespace

std::string brief(const Simulation& simulation) {
  return fmt::format("{:.6g} s simulated, {} payload events.", simulation.duration(),
                     simulation.payload_events().size());
}

std::string full(const Simulation& simulation) {
  const std::vector<SimulationEvent> events = simulation.payload_events();
  std::string text = fmt::format(
      "{} simulated for {:.6g} s: {} samples, {} payload events, {} times a joint came to stick\n",
      simulation.robot, simulation.duration(), simulation.result.log.num_samples(), events.size(),
      simulation.times_stuck());
  for (const SimulationEvent& event : events)
    text += fmt::format("  {} at {:.4f} s\n", to_string(event.kind), event.time);
  return text + joint_table(simulation).to_text(2);
}

std::string json(const Simulation& simulation) {
  nlohmann::ordered_json json{{simulation.is_replay ? "replay" : "scenario", simulation.source},
                              {"robot", simulation.robot},
                              {"samples", simulation.result.log.num_samples()},
                              {"duration", simulation.duration()}};
  json["events"] = nlohmann::ordered_json::array();
  for (const SimulationEvent& event : simulation.result.events) {
    json["events"].push_back({{"time", event.time},
                              {"kind", to_string(event.kind)},
                              {"joint", event.joint < 0 ? nlohmann::ordered_json(nullptr)
                                                        : nlohmann::ordered_json(event.joint + 1)}});
  }
  const sim::SolverCounts& counts = simulation.result.counts;
  json["solver"] = {{"steps", counts.steps},
                    {"evaluations", counts.evaluations},
                    {"failed_steps", counts.failed_steps},
                    {"restarts", counts.restarts}};
  const Eigen::VectorXd error = simulation.tracking_error();
  if (error.size() > 0) json["rms_tracking_error"] = host::json_array(error);
  return text_of(json);
}

page::Page page(const Simulation& simulation) {
  const data::Log& log = simulation.result.log;
  page::Page page =
      page::new_page(fmt::format("{}: simulation", simulation.robot), file_name_of(simulation.source));
  page.verdict(brief(simulation));
  page.table(joint_table(simulation));
  page.plots("Position", channel_plots(simulation, log.q, log.qref, "position [rad, m]"));
  page.plots("Torque", channel_plots(simulation, log.tau, {}, "torque [N·m, N]"));
  return page;
}

}  // namespace heft::report
