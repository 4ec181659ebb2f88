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
  Eigen::MatrixXd deviation, threshold, offset;              ///< samples × n [N·m, N]
  std::array<Eigen::MatrixXd, kCircumstances> circumstance;  ///< samples × n each
  std::vector<char> judged, contact;
  std::vector<Event> events;
  long refused{0};  ///< samples that core did not take
};

/// @param with_circumstances  false: they are not kept
Run run_core(const model::Robot& robot, const Signals& signals, const Thresholds& thresholds,
             bool with_circumstances);

/// Thresholds that nothing exceeds, for learning.
Thresholds open_thresholds(double bandwidth, const Eigen::VectorXd& rest_speed);

}  // namespace heft::monitor
