/// @file
/// When the error of a prediction counts.
#pragma once

#include <vector>

#include "heft/data/differentiate.hpp"

namespace heft::validate {

/// Left out of every error at either end of a log, and beside its gaps [s].
inline constexpr double kScoreEnd = 0.5;

/// The time of a log without what is within kScoreEnd of its ends and of its gaps, where the motion is derived from positions on
/// one side alone. A log of which less than a half would remain counts up to its gaps, one of less than a second all through.
class ScoredTime {
 public:
  /// @param begin,end  first and last time stamp [s]
  ScoredTime(double begin, double end, std::vector<data::TimeGap> gaps);

  bool counts(double time) const { return is_inside(time) && !is_in_gap(time); }
  /// Not within kScoreEnd of the ends.
  bool is_inside(double time) const { return time >= from_ && time <= to_; }
  /// In a gap, or beside one.
  bool is_in_gap(double time) const;
  /// false: the log is too short for it, all samples count.
  bool ends_left_out() const { return ends_; }

 private:
  bool ends_;
  double from_, to_, beside_;
  std::vector<data::TimeGap> gaps_;
};

}  // namespace heft::validate
