/// @file
/// The check behind its samples, so that one log can be judged under many alterations.
#pragma once

#include <string>

#include "heft/plausibility/plausibility.hpp"
#include "samples.hpp"

namespace heft::plausibility {

/// As check_torque, from the samples of a log.
/// @param log  its path, for messages
TorqueCheck check_samples(const model::Robot& robot, const Samples& samples, const std::string& log,
                          const Options& options);

}  // namespace heft::plausibility
