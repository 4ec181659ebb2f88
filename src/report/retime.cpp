#include "heft/report/retime.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "host/json.hpp"
#include "page_lines.hpp"
#include "safety_words.hpp"

namespace heft::report {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using retime::Limit;
using retime::Retiming;

std::string path_in_words(const Retiming& found) {
  const retime::Path& path = found.path;
  return fmt::format("{} points, {:.4g} rad (m) long, within {:.4f} rad (m) of {}", path.s.size(),
                     path.length(), path.deviation,
                     path.from_log ? "the log's positions" : "straight lines from point to point");
}

page::Table limit_table(const Retiming& found) {
  page::Table table({"joint", "torque limit [N·m, N]", "used [%]", "velocity limit [rad/s, m/s]", "used [%]",
                     "acceleration limit [rad/s², m/s²]", "used [%]"});
  const auto limit = [](double value) { return std::isfinite(value) ? page::number(value, 4) : "–"; };
  const auto used = [](double share, double of) {
    return std::isfinite(of) ? fmt::format("{:.1f}", 100.0 * share) : "–";
  };
  for (Index j = 0; j < found.torque.size(); ++j) {
    table.add_row({std::to_string(j + 1), limit(found.torque[j]), used(found.torque_use[j], found.torque[j]),
                   limit(found.velocity[j]), used(found.velocity_use[j], found.velocity[j]),
                   limit(found.acceleration[j]), used(found.acceleration_use[j], found.acceleration[j])});
  }
  return table;
}

page::Table share_table(const Retiming& found) {
  page::Table table({"what decides", "of the time [%]"});
  for (const retime::Share& share : found.shares) {
    table.add_row({fmt::format("{} of joint {}", to_string(share.limit), share.joint + 1),
                   fmt::format("{:.1f}", 100.0 * share.share)});
  }
  return table;
}

std::string rehearsal_in_words(const Retiming& found) {
  if (!found.rehearsal || !found.rehearsal->unable.empty()) return "Not rehearsed on the simulated arm";
  const retime::Rehearsal& run = *found.rehearsal;
  return fmt::format("Rehearsed on the simulated arm: {}; {:.2g} rad (m) off the reference at most",
                     run.failure.empty() ? "all limits kept" : "limit exceeded: " + run.failure,
                     run.tracking_error);
}

/// What stays unused of the limits.
std::string margin_in_words(const Retiming& found) {
  const double least = std::min(found.torque_margin.minCoeff(), found.velocity_margin.minCoeff());
  std::string text = fmt::format("Left to the controller: {} % of every limit", percent_text(least));
  const auto add = [&](const VectorXd& margin, const char* name) {
    for (Index j = 0; j < margin.size(); ++j) {
      if (margin[j] > least)
        text += fmt::format(", {} % of the {} of joint {}", percent_text(margin[j]), name, j + 1);
    }
  };
  add(found.torque_margin, "torque");
  add(found.velocity_margin, "velocity");
  return text;
}

std::string check_in_words(const Retiming& found) {
  return fmt::format(
      "Checked between the places of the path, too: limits were lowered by up to {:.2g} % there, which costs {:.2g} % of the time",
      100.0 * found.lowered, 100.0 * found.longer);
}

nlohmann::ordered_json active_of(const Retiming& found) {
  nlohmann::ordered_json active = nlohmann::ordered_json::array();
  for (const retime::Stretch& stretch : found.active) {
    active.push_back({{"begin", stretch.begin},
                      {"end", stretch.end},
                      {"joint", stretch.joint + 1},
                      {"limit", to_string(stretch.limit)}});
  }
  return active;
}

page::PlotSpec speed_plot(const Retiming& found) {
  page::PlotSpec spec;
  spec.title = "Speed over the path";
  spec.x_label = "way on the path [rad, m]";
  spec.y_label = "speed on the path [rad/s, m/s]";
  page::Series fastest = page::line("fastest from which all limits can be kept to the end", found.profile.s,
                                    found.profile.fastest, page::Hue::kVermillion);
  fastest.style = page::Style::kDashed;
  spec.series.push_back(fastest);
  spec.series.push_back(page::line("motion", found.profile.s, found.profile.speed, page::Hue::kBlue));
  return spec;
}

/// A bar for each stretch, in the row of its joint.
page::PlotSpec active_plot(const Retiming& found) {
  page::PlotSpec spec;
  spec.title = "Limits that decide";
  spec.x_label = "time [s]";
  spec.y_label = "joint";
  spec.y_range = {{0.0, static_cast<double>(found.torque.size()) + 1.0}};
  constexpr double kHalf = 0.35;
  const auto add = [&](Limit limit, page::Hue hue) {
    page::Series series{to_string(limit), {}, {}, {}, page::Style::kBand, hue};
    for (const retime::Stretch& stretch : found.active) {
      if (stretch.limit != limit) continue;
      const double row = stretch.joint + 1.0;
      series.x.insert(series.x.end(), {stretch.begin, stretch.end, stretch.end});
      series.y.insert(series.y.end(), {row - kHalf, row - kHalf, kNaN});
      series.y_high.insert(series.y_high.end(), {row + kHalf, row + kHalf, kNaN});
    }
    if (!series.x.empty()) spec.series.push_back(std::move(series));
  };
  add(Limit::kTorque, page::Hue::kVermillion);
  add(Limit::kVelocity, page::Hue::kBlue);
  add(Limit::kAcceleration, page::Hue::kGreen);
  return spec;
}

/// Each joint over time with its limit, planned and simulated.
std::vector<page::PlotSpec> joints_over_time(const Retiming& found, const Eigen::MatrixXd& planned,
                                             const Eigen::MatrixXd& simulated, const VectorXd& limit,
                                             const std::string& label) {
  std::vector<page::PlotSpec> plots = joint_plots(found.log.time, planned, -limit, limit, label);
  for (std::size_t j = 0; j < plots.size() && simulated.cols() > 0; ++j) {
    page::Series series = page::line("simulated", found.rehearsal->log.time,
                                     simulated.col(static_cast<Index>(j)), page::Hue::kOrange);
    series.style = page::Style::kDashed;
    plots[j].series.push_back(std::move(series));
  }
  return plots;
}

}  // namespace

std::string brief(const Retiming& found) {
  if (!std::isfinite(found.path.duration))
    return fmt::format("{:.4g} s from rest to rest along the path.", found.duration());
  return fmt::format("{:.4g} s along the path, which took {:.4g} s: {:.3g} % {}.", found.duration(),
                     found.path.duration, 100.0 * std::abs(found.saved()),
                     found.saved() < 0.0 ? "longer" : "shorter");
}

std::string full(const Retiming& found) {
  std::string text = fmt::format("{}: {}\n{}Path: {}\n", found.robot.name, brief(found),
                                 verdict_text(found.judgement), path_in_words(found));
  text += limit_table(found).to_text(2);
  if (!found.shares.empty()) text += share_table(found).to_text(2);
  text += margin_in_words(found) + "\n" + rehearsal_in_words(found) + "\n" + check_in_words(found) + "\n";
  for (const std::string& note : found.notes) text += note + "\n";
  return text;
}

std::string json(const Retiming& found) {
  nlohmann::ordered_json json;
  put_verdict(json, found.judgement);
  json["robot"] = found.robot.name;
  json["duration_before"] = host::number_or_null(found.path.duration);
  json["duration_after"] = found.duration();
  json["active_limit"] = active_of(found);
  json["path"] = {{"source", found.path.source},
                  {"points", found.path.s.size()},
                  {"length", found.path.length()},
                  {"deviation", found.path.deviation}};
  json["limits"] = {{"torque", host::json_array(found.torque)},
                    {"velocity", host::json_array(found.velocity)},
                    {"acceleration", host::json_array(found.acceleration)},
                    {"torque_margin", host::json_array(found.torque_margin)},
                    {"velocity_margin", host::json_array(found.velocity_margin)},
                    {"lowered", found.lowered}};
  json["used"] = {{"torque", host::json_array(found.torque_use)},
                  {"velocity", host::json_array(found.velocity_use)},
                  {"acceleration", host::json_array(found.acceleration_use)}};
  json["rehearsal"] = nullptr;
  if (found.rehearsal && found.rehearsal->unable.empty()) {
    json["rehearsal"] = {{"passed", found.rehearsal->passed()},
                         {"torque", host::json_array(found.rehearsal->torque)},
                         {"velocity", host::json_array(found.rehearsal->velocity)},
                         {"tracking_error", found.rehearsal->tracking_error}};
  }
  json["notes"] = found.notes;
  return text_of(json);
}

page::Page page(const Retiming& found) {
  page::Page page = page::new_page(fmt::format("{}: fastest motion along a path", found.robot.name),
                                   file_name_of(found.path.source));
  page.verdict(brief(found), found.judgement);
  page.paragraph(fmt::format("Path: {}.", path_in_words(found)));
  page.plot(speed_plot(found));
  page.plot(active_plot(found));
  page.table(limit_table(found), "Limits and what the plan uses of them.");
  if (!found.shares.empty()) page.table(share_table(found), "What decides how fast the arm is.");
  page.paragraph(margin_in_words(found) + ". " + rehearsal_in_words(found) + ". " + check_in_words(found) +
                 ".");
  for (const std::string& note : found.notes) page.paragraph(note + ".");
  const Eigen::MatrixXd none;
  page.plots("Torque",
             joints_over_time(found, found.log.tau, found.rehearsal ? found.rehearsal->log.tau : none,
                              found.torque, "torque [N·m, N]"));
  page.plots("Velocity",
             joints_over_time(found, found.log.qd, found.rehearsal ? found.rehearsal->log.qd : none,
                              found.velocity, "velocity [rad/s, m/s]"));
  page.note(
      "The path is taken as given: nothing here knows what stands beside it. Torque is what the model predicts, friction "
      "included. This is a check of a model, not a safety function: run a new motion slowly first, with a hand at the stop.");
  return page;
}

}  // namespace heft::report
