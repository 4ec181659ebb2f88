/// @file
/// The middle of a few values.
#pragma once

#include <vector>

namespace heft::statistics {

/// The middle of the values, the mean of the two in the middle of an even number; NaN of none. Cost: n.
double median(std::vector<double> values);

}  // namespace heft::statistics
