/// @file
/// Settings of core's contact monitor from robot and thresholds.
#pragma once

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "heft/monitor/sized_thresholds.hpp"

namespace heft::monitor {

/// Inertia of motors and rotors, n × n [kg·m², kg].
Eigen::MatrixXd motor_inertia_of(const model::Robot& robot);

/// A longer time between samples is a gap [s].
/// @param period  between samples, nominal [s]
double longest_period(double period);

}  // namespace heft::monitor
