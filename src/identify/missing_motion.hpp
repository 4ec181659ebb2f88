/// @file
/// What the logs do not determine, and the motion that would.
#pragma once

#include <string>
#include <vector>

#include "heft/data/motion_stream.hpp"
#include "heft/identify/fit.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::identify {

/// Joints at rest in every log, from 1.
std::vector<int> resting_joints(const regression::RegressionColumns& columns,
                                const std::vector<data::StreamSummary>& logs);

/// Undetermined parameters of a fit by the motion they lack, one line each.
/// @param resting  joints, from 1, that never moved
std::vector<std::string> missing_motion(const Fit& fit, const std::vector<int>& resting);

}  // namespace heft::identify
