/// @file
/// Parts of bars and of JSON that answers share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/report/tracking.hpp"

namespace heft::report {

nlohmann::ordered_json tracking_json(const std::vector<track::Run>& runs);
/// What the controllers' model was made to be; empty for the scenario's own.
std::string wrong_sentence(const std::optional<track::WrongModel>& wrong);
/// Field "wrong_model", where there is one.
void put_wrong(nlohmann::ordered_json& json, const std::optional<track::WrongModel>& wrong);

/// "joint 1", "joint 2", ...: categories of bars.
std::vector<std::string> joint_names(Eigen::Index count);
/// Heights of bars.
std::vector<double> to_vector(const Eigen::VectorXd& values);

}  // namespace heft::report
