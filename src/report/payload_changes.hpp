/// @file
/// Changes of load as JSON, of a log and of a stream.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "heft/payload/payload.hpp"

namespace heft::report {

nlohmann::ordered_json changes_json(const std::vector<payload::LoadChange>& changes);

}  // namespace heft::report
