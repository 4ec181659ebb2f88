/// @file
/// The load at the flange from a log, estimated sample by sample as a controller would.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
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
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// Numbers with their uncertainty.
struct Estimated {
  Eigen::VectorXd value;
  Eigen::VectorXd std;         ///< standard deviations
  Eigen::VectorXd half_width;  ///< of the 95 % interval
  std::vector<bool> identifiable;
};

/// The load changed.
struct LoadChange {
  double time{0.0};         ///< when the torque began to differ [s]
  double mass_before{0.0};  ///< [kg]; NaN: not determined
  double mass{0.0};         ///< from then on [kg]; NaN: not determined
  double std{0.0};          ///< of `mass` [kg]; NaN: not determined
};

struct PayloadRun {
  int first_joint{1};
  int samples{0};
  double cutoff{0.0};        ///< [Hz]
  double block{0.0};         ///< length of the blocks behind the interval [s]
  int blocks{0};             ///< how many there were
  Estimated mass;            ///< 1 [kg]
  Estimated first_moment;    ///< 3, flange frame [kg·m]: known also where the mass is not
  Estimated com;             ///< 3, flange frame [m]; needs a mass well above its uncertainty
  Estimated inertia;         ///< 6: Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the flange frame's origin [kg·m²]
  Estimated coulomb_change;  ///< n: against the model [N·m, N]; joints below k: not identifiable
  Estimated viscous_change;  ///< n [N·m·s/rad, N·s/m]
  double mass_std_residual{0.0};  ///< share of the mass' standard deviation: this log's residual [kg]
  double mass_std_model{0.0};     ///< the model's parameters [kg]
  double mass_std_zero{0.0};      ///< the zero check [kg]
  /// The ten parameters of the load about the flange frame, m, m c, inertia, with their covariance, 10 × 10; entries
  /// that are not identifiable are the prior's.
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;
  double interval_factor{0.0};  ///< half-width of a 95 % interval in standard deviations
  /// n: torque that each joint feels of the load, in parts of what the load found would make it feel. All joints agree
  /// where it is 1; a torque constant that is 10 % too large shows as 1.1 against the others.
  Estimated torque_scale;
  /// The ten parameters about the last link frame (the recursion's own), to be added to the last link.
  InertialParameters<double> on_last_link{};
  bool mass_visible{false};            ///< some motion of this arm shows the mass in rows k..n
  std::optional<double> converged_at;  ///< log time from which the running mass stays at its final value [s]
  std::vector<LoadChange> changes;
  double load_since{0.0};  ///< log time at which the load stated above began [s]
  Eigen::VectorXi rows_used, rows_rejected, rows_at_rest;  ///< per joint
  int left_out{0};  ///< samples whose torque or velocity no such arm can have
  Eigen::VectorXd time, mass_history,
      mass_std_history;  ///< running values [s, kg, kg]; NaN: not identifiable yet
  /// What the data do not determine and the motion that would; empty: nothing is missing.
  std::string missing;
};

/// Runs core's PayloadEstimator over a log, sample by sample, on the torque that `robot` does not explain.
///
/// Torque and every column of the regressor pass the same causal low-passes
/// (src/payload/causal_signals.hpp; choose_cutoff; a controller would set the cut-off beforehand). Each
/// sample gives n − k + 1 rows. The friction of every joint used may differ from the model, because it does
/// from day to day and under load. A load that changes within the log shows as innovations far off for long
/// (a two-sided cumulative sum per joint); then the covariance is taken up again and the estimate begins
/// anew.
///
/// Interval: 95 %, Student's t, from the block jackknife over this log (residuals are correlated in time),
/// the model's own covariance and the zero check. It holds for the torque scale given: a torque constant
/// that is 2 % off moves the mass by 2 %.
///
/// Flange frame: the robot's tip (URDF tip link); where the chain ends with the last moving link, that
/// link's frame.
///
/// Converged: the first time from which the running mass stays within the larger of its interval and 5 % of
/// its final value; known in hindsight only.
///
/// @param robot  with the parameters of a model that fits the arm without load
/// @throws DataError when k is outside 1..n, or the log lacks torque or joints. A log that cannot answer is
///         no error: see `identifiable` and `missing`.
PayloadRun run_payload(const model::Robot& robot, const data::Log& log, const PayloadRunOptions& options);

}  // namespace heft::payload
