/// @file
/// The load at the flange from a log, estimated sample by sample as a controller would.
#pragma once

#include <functional>
#include <optional>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "heft/payload/payload.hpp"
#include "heft/statistics/residual_statistics.hpp"

namespace heft::payload {

struct PayloadRunOptions {
  int first_joint{1};  ///< k: torques of joints k..n are used, 1-based
  double cutoff{0.0};  ///< of the causal low-pass [Hz]; 0: that of `residual`, else chosen from the motion
  bool torque_at_joint{false};    ///< torque measured behind the gear: no friction in it
  double standstill_speed{0.03};  ///< rows of slower joints are left out [rad/s, m/s]
  double gate{10.0};              ///< rows further off than this many standard deviations are left out
  /// How the model misses the torque without load, from its fit; absent: measured on this log in a first
  /// run.
  std::optional<statistics::ResidualStatistics> residual{};
  /// Covariance of the model's 14n parameters, from its fit; absent: the interval leaves the model's error
  /// out.
  std::optional<Eigen::MatrixXd> model_covariance{};
  /// Standard deviation of the mass that the model shows without any load, beyond its own interval (zero
  /// check) [kg].
  double zero_mass_std{0.0};
  /// Measured torque in parts of the true one, one a joint, with its standard deviation: taken off the load, and in its
  /// interval. Empty: 1, and not in the interval.
  std::vector<statistics::Interval> drive_scale{};
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// Runs core's PayloadEstimator over a log, sample by sample, on the torque that `robot` does not explain.
///
/// Torque and every column of the regressor pass the same causal low-passes
/// (causal_signals.hpp; choose_cutoff; a controller would set the cut-off beforehand). Each sample gives
/// n − k + 1 rows. The friction of every joint used may differ from the model, because it does from day to
/// day and under load. A load that changes within the log shows as innovations far off for long (a two-sided
/// cumulative sum per joint); then the covariance is widened to the prior's and the estimate starts again.
///
/// Interval: 95 %, Student's t, from the block jackknife over this log (residuals are correlated in time),
/// the model's own covariance, the zero check and the torque scale where that is known. Without, it holds for the torque
/// scale given: torque constants that are 2 % off move the mass by 2 %.
///
/// Flange frame: the robot's tip (URDF tip link); where the chain ends with the last moving link, that
/// link's frame.
///
/// Converged: the first time from which the running mass stays within the larger of its interval and 5 % of
/// its final value; known in hindsight only.
///
/// @param robot  with the parameters of a model that fits the arm without load, as the log's torque shows it:
///               see model::as_measured()
/// @throws DataError when k is outside 1..n, or the log lacks torque or joints. A log that cannot answer is
///         no error: see `identifiable` and `missing`.
PayloadRun run_payload(const model::Robot& robot, const data::Log& log, const PayloadRunOptions& options);

}  // namespace heft::payload
