/// @file
/// Parts of what is said of stiffnesses.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/page/page.hpp"
#include "heft/page/table.hpp"
#include "heft/report/stiffness.hpp"
#include "heft/stiffness/stiffness.hpp"

namespace heft::report {

bool slides(const model::Robot& robot, int joint);

/// "9.12 kN·m/rad", "∞"; the unit of a prismatic joint is N/m.
std::string stiffness_in_words(double stiffness, bool prismatic);
/// "5.71 to 19.8 kN·m/rad", "at least 1.2 kN·m/rad" where the upper end is open, "–" where there is no lower one.
std::string stiffness_interval_in_words(double low, double high, bool prismatic);

std::vector<double> numbers(const Eigen::VectorXd& v);

/// From deflections: the sentence, the text, what a page shows.
std::string deflection_verdict(const stiffness::Stiffness& answer);
std::string deflection_text(const stiffness::Stiffness& answer);
void put_deflections(nlohmann::ordered_json& json, const stiffness::Stiffness& answer);
void add_deflections(page::Page& page, const stiffness::Stiffness& answer);

/// From encoders.
std::string encoder_verdict(const stiffness::Stiffness& answer);
std::string encoder_text(const stiffness::Stiffness& answer);
void put_encoders(nlohmann::ordered_json& json, const stiffness::Stiffness& answer);
/// @param logs  that were fitted; none: the loops are not drawn
void add_encoders(page::Page& page, const stiffness::Stiffness& answer, const std::vector<data::Log>& logs);

/// The tool under load.
/// @param path  log whose positions were followed; without samples: none
std::string tool_text(const stiffness::ToolUse& use, const data::Log& path);
void put_tool(nlohmann::ordered_json& json, const stiffness::ToolUse& use, const data::Log& path);
void add_tool(page::Page& page, const stiffness::ToolUse& use, const data::Log& path);

/// What the commands write.
nlohmann::ordered_json to_json(const StiffnessReport& report);
nlohmann::ordered_json to_json(const stiffness::MeasurementPlan& plan);
nlohmann::ordered_json to_json(const MotorSideReport& report);

}  // namespace heft::report
