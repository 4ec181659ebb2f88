/// @file
/// From when to when a joint moves, in bounded memory.
#pragma once

#include <cstddef>
#include <vector>

namespace heft::data {

/// First and last time at which a speed is above a threshold that is known only after the last sample: 1 % of
/// the largest speed, say. Kept are the samples that could still be the answer: towards the front those
/// faster than all before, towards the end those faster than all after.
class MovingSpan {
 public:
  void add(double time, double speed);
  /// What a later stretch of the same joint has.
  void add(const MovingSpan& later);
  double top_speed() const { return front_.empty() ? 0.0 : front_.back().speed; }
  /// NaN: never above.
  double first_above(double threshold) const;
  double last_above(double threshold) const;

 private:
  struct Sample {
    double time, speed;
  };
  static constexpr std::size_t kMost = 4096;

  template <typename Merge>
  static void halve(std::vector<Sample>& samples, const Merge& merge);

  std::vector<Sample> front_, back_;
};

}  // namespace heft::data
