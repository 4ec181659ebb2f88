/// @file
/// What is said of any motion that was made safe: limits, distances, rehearsal.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "heft/excite/excite.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

nlohmann::ordered_json rows_of(const Eigen::MatrixXd& values);
std::string percent_text(double share);
/// A plot a joint of values over time with their limits; rows are times.
std::vector<page::PlotSpec> joint_plots(const Eigen::VectorXd& time, const Eigen::MatrixXd& values,
                                        const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                                        const std::string& label);

/// Largest values a joint and their share of the limit.
page::Table limit_table(const excite::Motion& motion);
/// Phases, distances, speed, rehearsal and pairs that are not watched, a line each.
std::string safety_text(const excite::Motion& motion);
/// Adds verdict, phases, limits, reached, rehearsal.
void add_safety(const excite::Motion& motion, nlohmann::ordered_json& json);
/// Tables, and plots of distance, speed, position, velocity, acceleration and torque over time.
void add_safety(const excite::Motion& motion, page::Page& page);
page::Tone tone_of(const excite::Motion& motion);

}  // namespace heft::report
