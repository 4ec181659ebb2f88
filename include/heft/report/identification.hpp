/// @file
/// What was identified: as one sentence, as text, as JSON and as a page.
#pragma once

#include <string>
#include <vector>

#include "heft/identify/identify.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// The error in percent of the joint's largest torque, on average and in the worst joint.
std::string brief(const identify::Identification& found);
/// All of it for a terminal, as `heft identify` prints it.
std::string full(const identify::Identification& found);
/// One JSON object; its fields are described in src/report/README.md.
std::string json(const identify::Identification& found);
/// Verdict, errors with plots where Options::traces asked for them, parameters, what the logs do not determine.
page::Page page(const identify::Identification& found);

/// Remarks about a URDF that the model was written into, one a line under a heading; "" without any.
std::string urdf_notes(const std::vector<std::string>& notes);

}  // namespace heft::report
