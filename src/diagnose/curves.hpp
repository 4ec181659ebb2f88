/// @file
/// Means of a joint's torque over velocity, around reversals, and of its residual over position and velocity.
#pragma once

#include <vector>

#include "heft/diagnose/diagnose.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Curves of every joint.
/// @param table  of the validation logs, the rows of Diagnosis::validate one after the other
std::vector<JointCurves> curves_of(const Diagnosis& diagnosis, const MotionTable& table);

}  // namespace heft::diagnose
