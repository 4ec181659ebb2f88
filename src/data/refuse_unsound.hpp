/// @file
/// What a log that comes from memory must hold.
#pragma once

#include "heft/data/log.hpp"

namespace heft::data {

/// Checks a log that comes from memory as a reader checks a file.
/// @throws DataError naming row and column when sizes differ, a number is not finite or time does not increase
void refuse_unsound(const Log& log);

}  // namespace heft::data
