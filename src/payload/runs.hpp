/// @file
/// How the estimate of a load is made for an unloaded arm.
#pragma once

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "heft/payload/payload.hpp"
#include "payload_run.hpp"

namespace heft::payload {

/// The arm as the torque of its logs shows it.
model::Robot as_measured(const UnloadedArm& arm, const Options& options);

/// @throws InputError when the robot does not have this joint, from 1
void refuse_rows(const model::Robot& robot, int first_joint);

PayloadRunOptions run_options(const UnloadedArm& arm, const data::Log& log, const Options& options,
                              double zero_mass_std);

}  // namespace heft::payload
