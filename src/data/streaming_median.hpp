/// @file
/// The median of more values than are kept.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace heft::data {

/// The middle one (number size/2 in ascending order) of any number of positive values, exactly, in bounded
/// memory. Many values are to be fed more than once: bit by bit of their binary form the range in which the
/// middle lies is narrowed down.
class StreamingMedian {
 public:
  void add(double value);
  /// After all values: true when value() is known, false when they are to be fed once more.
  bool finish_pass();
  double value() const { return value_; }

 private:
  static constexpr std::size_t kMost = std::size_t{1} << 17;
  static constexpr int kBits = 16;  ///< resolved in one pass

  void count(double value);

  std::vector<double> values_;         ///< all of them, or those in the range
  std::vector<std::uint64_t> counts_;  ///< of the kBits after the known ones; empty: collecting
  std::uint64_t known_{0};             ///< leading bits of the middle one
  int known_bits_{0};
  std::uint64_t rank_{0};   ///< of the middle one among those in the range
  std::uint64_t total_{0};  ///< in the first pass
  bool first_pass_{true};
  double value_{0.0};
};

/// The middle one of the steps of a sequence.
/// @param steps       to which all of them were added
/// @param each_value  calls its argument with every value of the sequence, once more each time that it is called
double median_of_steps(StreamingMedian steps,
                       const std::function<void(const std::function<void(double)>&)>& each_value);

}  // namespace heft::data
