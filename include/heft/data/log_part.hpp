/// @file
/// A stretch of a log.
#pragma once

#include "heft/data/log.hpp"

namespace heft::data {

/// The rows with from ≤ t < to [s], all columns; the path says which stretch it is.
Log part_of(const Log& log, double from, double to);

}  // namespace heft::data
