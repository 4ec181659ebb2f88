/// @file
/// A log through core's contact monitor, sample by sample.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "causal_sample.hpp"
#include "heft/data/log.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// What a log gives to core: measured as it is, what is derived derived causally.
struct Signals {
  Eigen::VectorXd time;                  ///< [s]
  Eigen::MatrixXd q, qd, tau, friction;  ///< samples × n
  bool velocity_derived{false};
};

/// @param robot  as its torque was measured (model::as_measured)
/// @throws DataError when the log has no torque
Signals signals_of(const model::Robot& robot, const data::Log& log);

/// An event with its sample.
struct Event {
  Eigen::Index row{0};
  int kind{0};  ///< ContactEvent
  std::array<double, 4> load{};
};

/// What core said about each sample.
struct Run {
  Eigen::MatrixXd deviation, threshold;                                 ///< samples × n [N·m, N]
  Eigen::MatrixXd residual, level_threshold, change, change_threshold;  ///< likewise
  std::vector<char> judged, contact;
  std::vector<Event> events;
  long refused{0};  ///< samples that core did not take
};

Run run_core(const model::Robot& robot, const Signals& signals, const Thresholds& thresholds);

/// Of the samples of a log [s].
double median_period(const Eigen::VectorXd& time);

}  // namespace heft::monitor
