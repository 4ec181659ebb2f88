/// @file
/// A full model of an arm from logs, by recursive least squares over all joints.
#pragma once

#include <functional>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "heft/payload/payload.hpp"

namespace heft::payload {

struct RecursiveFitOptions {
  double cutoff{0.0};             ///< of the causal low-pass [Hz]; 0: chosen from the motion (choose_cutoff)
  bool torque_at_joint{false};    ///< torque measured behind the gear: no rotor inertia and no friction in it
  double standstill_speed{0.03};  ///< rows of slower joints are left out [rad/s, m/s]
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// Cut-off of the causal low-pass for a log: its pole at ten times the bandwidth of the motion, at least 3
/// Hz and at most a quarter of the sample rate. Torque and regressor are filtered alike, so the motion need
/// not pass unchanged; far above it there is only noise.
double choose_cutoff(const data::Log& log);

/// Fits ten inertial parameters, rotor inertia, Coulomb, viscous and offset of every joint.
///
/// Two passes of core's RecursiveLeastSquares over the samples, one scalar row a joint and sample, logs one
/// after the other. The first, with a guessed noise, gives the scatter and the correlation time of each
/// joint's residual; the second weights the rows by it. A third run over the samples gives the covariance.
///
/// Prior: the URDF's values, with standard deviations so wide (three times the mass, lengths of a link,
/// torques as large as the measured ones) that data override them. Directions the motion does not
/// determine, and those no motion could, stay at the prior. This is wanted: the model keeps sensible
/// masses, and no torque depends on them.
///
/// Torque and every column of the regressor pass the same causal low-passes
/// (causal_signals.hpp), so that the model is the one that an estimator in the loop needs.
///
/// Rows of joints at rest are left out: at rest friction takes up any torque below its level.
///
/// Behind the gears the model keeps neither rotor inertia nor friction, but the sensors' offsets, and its
/// record says where it was fitted.
///
/// @param robot  of a URDF, as its motors see it
/// @param logs  at least one, each with q and tau of the robot's joints; qd is used for the sign of
///         friction if present
/// @throws ModelError for more than model::kMaxJoints joints, DataError when a log lacks torque or joints.
///         Missing excitation is not an error but is given in `missing`.
/// Cost: 6 joints 21 thousand multiplications a row, one second for 50 s at 100 Hz.
RecursiveFit fit_recursively(const model::Robot& robot, const std::vector<data::Log>& logs,
                             const RecursiveFitOptions& options = {});

}  // namespace heft::payload
