/// @file
/// What a log holds and how it was understood: as a sentence, as text, as JSON.
#pragma once

#include <string>
#include <vector>

#include "heft/data/describe_log.hpp"

namespace heft::report {

/// "run.csv: text separated by blanks, 120 rows of 4 joints at 50 Hz over 2.38 s".
std::string brief(const data::LogDescription& log);
/// What `heft log` prints: columns, time, what the torque is, what is missing for which command.
std::string full(const data::LogDescription& log);
/// Fields as tools/README.md names them, a list with an entry a log.
std::string json(const std::vector<data::LogDescription>& logs);
/// "120 rows written".
std::string brief(const data::LogConversion& conversion);

}  // namespace heft::report
