/// @file
/// NaN for "none", infinity for "no bound".
#pragma once

#include <limits>

namespace heft {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace heft
