/// @file
/// What the jobs of `heft stiffness` have in common: the tool under load, the files they write.
#pragma once

#include "heft/report/stiffness.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {

/// Asks what the stiffness means for the tool, also along the log of --path, prints all, and writes model, compensated
/// path, JSON and page. A model without any stiffness is not written.
void finish_stiffness(const StiffnessCommandOptions& options, const model::Robot& robot,
                      report::StiffnessReport answer);

}  // namespace heft::tools
