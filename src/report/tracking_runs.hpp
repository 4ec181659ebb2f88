/// @file
/// Parts of bars and of JSON that answers share.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/report/tracking.hpp"

namespace heft::report {

nlohmann::ordered_json tracking_json(const std::vector<track::Run>& runs);

/// "joint 1", "joint 2", ...: categories of bars.
std::vector<std::string> joint_names(Eigen::Index count);
/// Heights of bars.
std::vector<double> to_vector(const Eigen::VectorXd& values);

}  // namespace heft::report
