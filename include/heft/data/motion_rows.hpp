/// @file
/// How many rows a motion may become.
#pragma once

namespace heft::data {

/// Rows of the log that a planned motion becomes, at most: some hundred megabytes.
inline constexpr double kMostMotionRows = 2e6;

/// @param duration  of the motion [s]
/// @param rate      rows a second [Hz]
/// @throws ModelError for more rows than kMostMotionRows
void refuse_many_rows(double duration, double rate);

}  // namespace heft::data
