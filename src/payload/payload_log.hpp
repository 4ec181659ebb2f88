/// @file
/// A log as the estimate of a load takes it.
#pragma once

#include <string>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/payload/payload.hpp"

namespace heft::payload {

/// A log for people who look at it afterwards, and the same as the estimator may see it.
struct PayloadLog {
  data::Log derived;  ///< qd, qdd filled in with zero phase where the log lacks them
  data::Log causal;   ///< only what was measured
};
PayloadLog read_payload_log(const data::LogSource& source, std::vector<std::string>* notes);

PayloadRunOptions run_options(const UnloadedArm& arm, const data::Log& log, const Options& options,
                              double zero_mass_std);

}  // namespace heft::payload
