/// @file
/// The last steps of every motion.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heft/excite/excite.hpp"

namespace heft::excite {

/// Adds the ways there and back, makes the log, checks every row and rehearses. Takes `motion.robot` and
/// `motion.limits`, fills in the rest except the judgement of the motion itself.
/// @throws NotIdentifiableError naming the limit that is exceeded
void finish_motion(Motion& motion, const std::vector<Piece>& core, const std::optional<Eigen::VectorXd>& from,
                   double rate, bool rehearsed);

}  // namespace heft::excite
