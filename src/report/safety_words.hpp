/// @file
/// What is said of any motion that was made safe: limits, distances, rehearsal.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "heft/excite/excite.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

nlohmann::ordered_json rows_of(const Eigen::MatrixXd& values);
std::string percent_text(double share);

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
