/// @file
/// What the jobs of `heft stiffness` have in common: the tool under load, the files they write.
#pragma once

#include <vector>

#include "heft/data/log.hpp"
#include "heft/report/stiffness.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {

/// The log of --path; without samples when there is none.
data::Log read_path(const StiffnessCommandOptions& options, const model::Robot& robot);

/// Asks what the stiffness means for the tool at these poses and along answer.path, prints all, and writes model,
/// compensated path, JSON and page. A model without any stiffness is not written.
void finish_stiffness(const StiffnessCommandOptions& options, report::StiffnessReport answer,
                      const std::vector<stiffness::NamedPose>& poses);

}  // namespace heft::tools
