/// @file
/// Settings of core's contact monitor from robot and thresholds.
#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "heft/core/monitor/contact_thresholds.hpp"
#include "heft/model/robot.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

template <int N>
ContactThresholds<double, N> sized_thresholds(const Thresholds& thresholds) {
  ContactThresholds<double, N> to;
  to.bandwidth = thresholds.bandwidth;
  to.adaptation = thresholds.adaptation;
  to.turning_time = thresholds.turning_time;
  to.load_rate = thresholds.load_rate;
  to.largest_step = thresholds.largest_step;
  for (std::size_t j = 0; j < to.joints.size(); ++j) to.joints[j] = thresholds.joints[j];
  return to;
}

/// Inertia of motors and rotors, n × n [kg·m², kg].
Eigen::MatrixXd motor_inertia_of(const model::Robot& robot);

/// A longer time between samples is a gap [s].
/// @param period  between samples, nominal [s]
double longest_period(double period);

}  // namespace heft::monitor
