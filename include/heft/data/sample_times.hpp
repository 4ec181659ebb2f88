/// @file
/// When the samples of a log were taken, where its time stamps scatter about an even clock.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::data {

/// What the positions say about time stamps that scatter.
struct SampleTimes {
  /// When each row was taken [s]: the stamps, or where the positions follow less than half of their scatter, the even clock
  /// and that part.
  Eigen::VectorXd time;
  double scatter{0.0};  ///< rms of the stamps about the even clock, in periods
  /// Part of the scatter that the positions follow: 1, they were sampled when the stamps say; 0, on the even clock, and the
  /// stamps were set later. NaN: the stamps are even, or no joint moves.
  double followed;
  double std;  ///< its standard deviation
  /// Whether that is below a tenth, so that the positions decide.
  bool known() const;
};

/// Estimates when samples were taken. The even clock is a line through the stamps of a second (a hundred rows at least) to both
/// sides. Lost rows count as well: as many as all later stamps say are lost, and before the row that the positions show. Where
/// samples are uneven, the fourth difference of a position over the numbers of its rows is that of velocity times their distance
/// from the clock; the slope of the one over the other is `followed`, with its standard deviation from blocks of a second.
/// O(rows × joints).
SampleTimes sample_times(const Log& log);

/// The log with time stamps that say when its samples were taken, where the positions show that they do not.
/// @param notes  gets a line if stamps were changed, or if they scatter and the positions do not decide
Log with_sample_times(Log log, std::vector<std::string>& notes);

}  // namespace heft::data
