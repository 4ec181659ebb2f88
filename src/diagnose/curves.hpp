/// @file
/// Means of a joint's torque over velocity, around reversals, and of its residual over position and velocity.
#pragma once

#include <vector>

#include "heft/diagnose/diagnose.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Curves of every joint.
/// @param table  of the validation logs, the rows of Diagnosis::validate one after the other
/// @throws std::invalid_argument where these are not its rows: logs whose stamps scatter have other ones as the search places
///         them than as filed.
std::vector<JointCurves> curves_of(const Diagnosis& diagnosis, const MotionTable& table);

}  // namespace heft::diagnose
