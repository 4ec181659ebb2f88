/// @file
/// A full model of an arm from logs, by recursive least squares over all joints.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/residual_statistics.hpp"

namespace heft::payload {

struct RecursiveFitOptions {
  double cutoff{0.0};             ///< of the causal low-pass [Hz]; 0: chosen from the motion (choose_cutoff)
  bool torque_at_joint{false};    ///< torque measured behind the gear: no rotor inertia and no friction in it
  double standstill_speed{0.03};  ///< rows of slower joints are left out [rad/s, m/s]
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// A fitted model and how far to trust it.
struct RecursiveFit {
  /// All 14 parameters a joint, their standard deviations (NaN: this parameter alone is not determined) and
  /// covariance (block jackknife, see BlockJackknife: holds for residuals correlated in time).
  model::ModelFile model;
  statistics::ResidualStatistics residual;
  Eigen::VectorXi rows;    ///< rows used per joint
  Eigen::VectorXd moving;  ///< time each joint was moving, all logs together [s]
  int samples{0};          ///< log rows, all logs together
  int left_out{0};         ///< samples whose torque or velocity no such arm can have
  int determined{0};       ///< combinations of parameters that the logs determine
  int determinable{0};     ///< combinations that any motion of this arm could determine
  /// What is missing for a usable model and the motion that would give it; empty: nothing.
  std::vector<std::string> missing;
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
/// (src/payload/causal_signals.hpp), so that the model is the one that an estimator in the loop needs.
///
/// Rows of joints at rest are left out: at rest friction takes up any torque below its level.
///
/// @param logs  at least one, each with q and tau of the robot's joints; qd is used for the sign of
///         friction if present
/// @throws ModelError for more than model::kMaxJoints joints, DataError when a log lacks torque or joints.
///         Missing excitation is not an error but is given in `missing`.
/// Cost: 6 joints 21 thousand multiplications a row, one second for 50 s at 100 Hz.
RecursiveFit fit_recursively(const model::Robot& robot, const std::vector<data::Log>& logs,
                             const RecursiveFitOptions& options = {});

}  // namespace heft::payload
