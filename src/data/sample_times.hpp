/// @file
/// When the samples of a log were taken, where its time stamps scatter about an even clock.
#pragma once

#include <limits>
#include <string>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::data {

/// What the positions say about time stamps that scatter.
struct StampScatter {
  double scatter{0.0};  ///< rms of the stamps about the even clock, in periods
  /// The same of means over a hundred rows.
  double wander{0.0};
  /// Part of the scatter that the positions follow: 1, they were sampled when the stamps say; 0, on the even clock, and the
  /// stamps were set later. NaN: the stamps are even or keep no beat, or no joint moves.
  double followed{std::numeric_limits<double>::quiet_NaN()};
  /// Its standard deviation. NaN: not known, or of less than three seconds.
  double std{std::numeric_limits<double>::quiet_NaN()};
  /// Samples are taken for placed on the even clock and by that part of the scatter, which is less than half.
  bool placed{false};
  /// Whether they wander by less than a fifth of a period, so that there is an even clock to speak of.
  bool keeps_beat() const;
  /// Whether the standard deviation is below a tenth, so that the positions decide.
  bool known() const;
  /// A line to tell if samples are placed, or if stamps scatter and the positions do not decide; otherwise empty.
  std::string note(const std::string& path) const;
};

/// When each row of a log was taken.
struct SampleTimes : StampScatter {
  Eigen::VectorXd time;  ///< [s]; the stamps, unless `placed`
};

/// Estimates when samples were taken. The even clock is a line through the stamps of a second (a hundred rows at least) to both
/// sides. Lost rows count as well: as many as all later stamps say are lost, and before the row that the positions show. Where
/// samples are uneven, the fourth difference of a position over the numbers of its rows is that of velocity times their distance
/// from the clock; the slope of the one over the other is `followed`, with its standard deviation from blocks of a second.
/// O(rows × joints).
SampleTimes sample_times(const Log& log);

}  // namespace heft::data
