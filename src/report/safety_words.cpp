#include "safety_words.hpp"

#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "host/json.hpp"

namespace heft::report {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::string millimetres(double metres) { return page::number(1e3 * metres, 3) + " mm"; }

/// One quantity over time with its limit, as designed and as simulated.
void add_curve(const std::string& title, const std::string& label, const data::Log& log,
               const VectorXd& designed, const excite::Motion& motion, const VectorXd& simulated,
               double limit, page::Page& page) {
  if (designed.size() == 0 || !std::isfinite(designed[0])) return;
  page::PlotSpec spec;
  spec.title = title;
  spec.x_label = "time [s]";
  spec.y_label = label;
  spec.series.push_back(page::line("designed", log.time, designed));
  if (simulated.size() > 0) {
    page::Series series = page::line("simulated", motion.rehearsal->log.time, simulated, page::Hue::kOrange);
    series.style = page::Style::kDashed;
    spec.series.push_back(series);
  }
  const double largest = std::max(designed.maxCoeff(), limit);
  spec.y_range = {{0.0, 1.1 * largest}};
  if (std::isfinite(limit)) {
    const Eigen::Vector2d ends(log.time[0], log.time[log.num_samples() - 1]);
    page::Series series = page::line("limit", ends, Eigen::Vector2d::Constant(limit), page::Hue::kVermillion);
    series.style = page::Style::kDashed;
    spec.series.push_back(series);
  } else {
    spec.y_range.reset();
  }
  page.plot(spec);
}

std::string floor_text(const excite::Motion& motion) {
  const excite::MotionLimits& limits = motion.limits;
  if (!limits.floor) return "no floor";
  return fmt::format("{} above the floor at {:.3g} m (nearest: {})", millimetres(limits.clearance),
                     *limits.floor, millimetres(motion.use.lowest_height - *limits.floor));
}

}  // namespace

std::vector<page::PlotSpec> joint_plots(const VectorXd& time, const MatrixXd& values, const VectorXd& lower,
                                        const VectorXd& upper, const std::string& label) {
  std::vector<page::PlotSpec> plots;
  for (Index j = 0; j < values.cols(); ++j) {
    page::PlotSpec spec;
    spec.title = fmt::format("Joint {}", j + 1);
    spec.x_label = "time [s]";
    spec.y_label = label;
    spec.series.push_back(page::line("motion", time, values.col(j)));
    const Eigen::Vector2d ends(time[0], time[time.size() - 1]);
    for (const double limit : {lower[j], upper[j]}) {
      if (!std::isfinite(limit)) continue;
      page::Series series =
          page::line("limit", ends, Eigen::Vector2d::Constant(limit), page::Hue::kVermillion);
      series.style = page::Style::kDashed;
      if (spec.series.size() > 1) series.label.clear();  // one entry in the legend
      spec.series.push_back(series);
    }
    plots.push_back(std::move(spec));
  }
  return plots;
}

nlohmann::ordered_json rows_of(const MatrixXd& values) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (Index j = 0; j < values.rows(); ++j) array.push_back(host::json_array(values.row(j).transpose()));
  return array;
}

std::string percent_text(double share) { return std::isfinite(share) ? page::number(100.0 * share, 3) : "–"; }

page::Table limit_table(const excite::Motion& motion) {
  const excite::MotionLimits& limits = motion.limits;
  const excite::LimitUse& use = motion.use;
  page::Table table({"joint", "from [rad, m]", "to", "% of range", "velocity", "%", "acceleration", "%",
                     "torque [N·m, N]", "%"});
  for (Index j = 0; j < use.velocity.size(); ++j) {
    table.add_row({std::to_string(j + 1), page::number(use.lowest[j], 3), page::number(use.highest[j], 3),
                   percent_text(use.position[j]), page::number(use.velocity[j], 3),
                   percent_text(use.velocity[j] / limits.velocity[j]), page::number(use.acceleration[j], 3),
                   std::isfinite(limits.acceleration[j])
                       ? percent_text(use.acceleration[j] / limits.acceleration[j])
                       : "–",
                   page::number(use.torque[j], 3),
                   std::isfinite(limits.torque[j]) ? percent_text(use.torque[j] / limits.torque[j]) : "–"});
  }
  return table;
}

std::string safety_text(const excite::Motion& motion) {
  const excite::MotionLimits& limits = motion.limits;
  const excite::LimitUse& use = motion.use;
  std::string text;
  for (const excite::Phase& phase : motion.phases) {
    if (motion.phases.size() > 1)
      text += fmt::format("{:.2f} s to {:.2f} s: {}\n", phase.begin, phase.end, phase.name);
  }
  const std::string speed =
      std::isfinite(limits.tool_speed)
          ? fmt::format("{:g} m/s (fastest: {} m/s)", limits.tool_speed, page::number(use.tool_speed, 3))
          : fmt::format("no limit (fastest: {} m/s)", page::number(use.tool_speed, 3));
  text += fmt::format("Speed of tool and link origins: {}\n", speed);
  if (std::isfinite(use.link_distance)) {
    text += fmt::format(
        "Links keep their clearance of {} (less for pairs that no pose separates further); nearest: {}, {}; {}\n",
        millimetres(limits.clearance), millimetres(use.link_distance), use.closest_links, floor_text(motion));
  } else {
    text += fmt::format("No two links can meet; {}\n", floor_text(motion));
  }
  if (std::isfinite(use.obstacle_distance)) {
    text += fmt::format("Obstacles: {}; nearest: {}\n", limits.obstacles.size(),
                        millimetres(use.obstacle_distance));
  }
  if (motion.rehearsal) {
    const excite::Rehearsal& run = *motion.rehearsal;
    text += fmt::format(
        "Rehearsed on the simulated arm: all limits kept; {:.3g} rad (m) off the reference, {} m/s{}\n",
        run.tracking_error, page::number(run.use.tool_speed, 3),
        std::isfinite(run.shape_distance) ? fmt::format(", {} between the collision shapes of {}",
                                                        millimetres(run.shape_distance), run.nearest_shapes)
                                          : std::string());
  } else {
    text += "Not rehearsed on the simulated arm\n";
  }
  for (const collision::ExcludedPair& pair : limits.arm.excluded) {
    if (pair.reason.starts_with("neighbours")) continue;
    text += fmt::format("Not watched: {} and {}, {}\n", pair.first, pair.second, pair.reason);
  }
  return text;
}

void add_safety(const excite::Motion& motion, nlohmann::ordered_json& json) {
  const excite::MotionLimits& limits = motion.limits;
  const excite::LimitUse& use = motion.use;
  json["verdict"] = to_string(motion.judgement.verdict);
  json["reasons"] = motion.judgement.reasons;
  json["phases"] = nlohmann::ordered_json::array();
  for (const excite::Phase& phase : motion.phases)
    json["phases"].push_back({{"name", phase.name}, {"begin", phase.begin}, {"end", phase.end}});
  json["limits"] = {{"margin", limits.margin},
                    {"lower", host::json_array(limits.lower)},
                    {"upper", host::json_array(limits.upper)},
                    {"velocity", host::json_array(limits.velocity)},
                    {"acceleration", host::json_array(limits.acceleration)},
                    {"torque", host::json_array(limits.torque)},
                    {"tool_speed", host::number_or_null(limits.tool_speed)},
                    {"floor", limits.floor ? host::number_or_null(*limits.floor) : nullptr},
                    {"clearance", limits.clearance},
                    {"obstacles", limits.obstacles.size()},
                    {"pairs_watched", limits.arm.pairs.size()}};
  json["limits"]["not_watched"] = nlohmann::ordered_json::array();
  for (const collision::ExcludedPair& pair : limits.arm.excluded)
    json["limits"]["not_watched"].push_back({{"links", {pair.first, pair.second}}, {"reason", pair.reason}});
  const auto reached = [](const excite::LimitUse& of) {
    return nlohmann::ordered_json{{"lowest", host::json_array(of.lowest)},
                                  {"highest", host::json_array(of.highest)},
                                  {"velocity", host::json_array(of.velocity)},
                                  {"acceleration", host::json_array(of.acceleration)},
                                  {"torque", host::json_array(of.torque)},
                                  {"tool_speed", of.tool_speed},
                                  {"link_distance", host::number_or_null(of.link_distance)},
                                  {"closest_links", of.closest_links},
                                  {"obstacle_distance", host::number_or_null(of.obstacle_distance)},
                                  {"lowest_height", host::number_or_null(of.lowest_height)},
                                  {"box_distance", host::number_or_null(of.box_distance)}};
  };
  json["reached"] = reached(use);
  json["reached"]["nearest"] = use.worst;
  json["reached"]["inside"] = use.inside;
  json["rehearsal"] = nullptr;
  if (motion.rehearsal) {
    json["rehearsal"] = reached(motion.rehearsal->use);
    json["rehearsal"]["passed"] = motion.rehearsal->passed;
    json["rehearsal"]["tracking_error"] = motion.rehearsal->tracking_error;
    json["rehearsal"]["shape_distance"] = host::number_or_null(motion.rehearsal->shape_distance);
  }
}

void add_safety(const excite::Motion& motion, page::Page& page) {
  const excite::MotionLimits& limits = motion.limits;
  const data::Log& log = motion.log;
  page.heading("Limits and safety");
  std::istringstream lines(safety_text(motion));
  for (std::string line; std::getline(lines, line);) page.paragraph(line + ".");
  page.table(limit_table(motion), "Largest values on the way and their share of the limit.");
  page.note(
      "Torque is what the model predicts, friction included; the design keeps it inside its limit for "
      "friction of either sign. Links are kept apart as capsules around their collision shapes; the "
      "rehearsal looks at the shapes themselves. This is a check of a model, not a safety function: run a "
      "new motion slowly first, with a hand at the stop.");
  const excite::SpaceRecord space = excite::in_space(motion.robot, limits, log);
  excite::SpaceRecord simulated;
  if (motion.rehearsal) simulated = excite::in_space(motion.robot, limits, motion.rehearsal->log);
  add_curve("Smallest distance between links beyond their clearance", "distance [m]", log, space.link_spare,
            motion, simulated.link_spare, 0.0, page);
  add_curve("Smallest distance from obstacles", "distance [m]", log, space.obstacle_distance, motion,
            simulated.obstacle_distance, limits.clearance, page);
  add_curve("Lowest point above the base", "height [m]", log, space.height, motion, simulated.height,
            limits.floor.value_or(0.0) + limits.clearance, page);
  add_curve("Speed of the fastest of tool and link origins", "speed [m/s]", log, space.tool_speed, motion,
            simulated.tool_speed, limits.tool_speed, page);
  page.heading("Motion");
  page.plots("Position", joint_plots(log.time, log.q, limits.lower, limits.upper, "position [rad, m]"));
  page.plots("Velocity",
             joint_plots(log.time, log.qd, -limits.velocity, limits.velocity, "velocity [rad/s, m/s]"));
  page.plots("Acceleration", joint_plots(log.time, log.qdd, -limits.acceleration, limits.acceleration,
                                         "acceleration [rad/s², m/s²]"));
  page.plots("Torque", joint_plots(log.time, log.tau, -limits.torque, limits.torque, "torque [N·m, N]"));
}

page::Tone tone_of(const excite::Motion& motion) {
  switch (motion.judgement.verdict) {
    case host::Verdict::kGood: return page::Tone::kGood;
    case host::Verdict::kDoubtful: return page::Tone::kNeutral;
    case host::Verdict::kBad: break;
  }
  return page::Tone::kBad;
}

}  // namespace heft::report
