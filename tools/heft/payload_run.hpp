/// @file
/// The online terminal-link estimator over a log, sample by sample.
#pragma once

#include <functional>
#include <optional>

#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "options.hpp"
#include "payload_result.hpp"

namespace heft::tools {

/// How the estimator runs.
struct PayloadSettings {
  int rows{5};                    ///< k: torques of joints k..n are used, 1 ≤ k ≤ n
  double forgetting_factor{1.0};  ///< a sample, 0 < λ ≤ 1
  TorqueAt torque_at{TorqueAt::kMotor};
  std::optional<double> true_mass;  ///< carried into the result for plots and text [kg]
};

/// @param log       q, qd, qdd and tau present
/// @param progress  called with 0..1
/// @throws NotIdentifiableError when the motion does not determine the mass: says what is missing.
PayloadResult run_payload(const model::Robot& robot, const data::Log& log, const PayloadSettings& settings,
                          const std::function<void(double)>& progress);

}  // namespace heft::tools
