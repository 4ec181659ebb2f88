/// @file
/// Torque from outside before any filter, and its deviation from free motion: learning goes through a log many times, but
/// needs the dynamics once.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "causal_run.hpp"
#include "heft/model/robot.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// What core's momentum observer makes of the samples of a log. The first sample gives none.
struct Balance {
  Eigen::VectorXd time;        ///< [s]
  Eigen::VectorXd period;      ///< since the sample before [s]
  Eigen::MatrixXd outside;     ///< torque that the model misses, samples × n [N·m, N]
  Eigen::MatrixXd explained;   ///< torque that it explains
  Eigen::MatrixXd qd;          ///< [rad/s, m/s]
  double longest_period{0.1};  ///< a longer time is a gap, after which filters start anew [s]
};
Balance balance_of(const model::Robot& robot, const Signals& signals);

/// A balance through core's ContactDeviation.
struct Deviations {
  Eigen::MatrixXd level, change;  ///< sizes of residual and change, each by its threshold, samples × n
  Eigen::MatrixXi phase;          ///< MotionPhase
  Eigen::VectorXd load_rate;      ///< [N·m/s, N/s]
  std::vector<char> judged;       ///< without start and gaps
};
Deviations deviations_of(const Balance& balance, const Thresholds& thresholds);

}  // namespace heft::monitor
