/// @file
/// Whether sums belong to a robot, and which log is which.
#pragma once

#include "heft/identify/sums.hpp"

namespace heft::identify {

/// Of everything that rows depend on: joint frames, gravity, columns.
std::uint64_t geometry_of(const model::Robot& robot, const regression::ModelStructure& structure);

/// @throws DataError when there is no log in the sums, or they are of another robot
void refuse_other_robot(const model::Robot& robot, const Sums& sums);

/// Of what a log holds: its size, and for each joint travel, top speed and largest torque to the last bit. Not negative.
long key_of(const data::StreamSummary& log);

/// @throws DataError when a log to judge on is in the sums
void refuse_fitted_logs(const Sums& sums, const std::vector<data::StreamSummary>& judged);

}  // namespace heft::identify
