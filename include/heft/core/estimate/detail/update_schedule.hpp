/// @file
/// How the updates of an estimate are spread over samples.
#pragma once

#include <cstdint>

namespace heft::detail {

struct UpdateSchedule {
  std::int32_t every{1};          ///< samples from one update to the next
  std::int32_t rows_a_sample{1};  ///< where an update is spread
  bool at_once{true};             ///< it is not
};

/// An update is finished before the next one is due: one sample begins it, one learns the noise or forgets the load, one
/// finishes it.
/// @param between  samples from one update to the next, > 0
/// @param rows     of an update
/// @param wanted   rows a sample; 0: all at once
template <typename Scalar>
constexpr UpdateSchedule update_schedule(const Scalar& between, std::int32_t rows,
                                         std::int32_t wanted) noexcept {
  const Scalar rounded = between + static_cast<Scalar>(0.5);
  UpdateSchedule schedule;
  schedule.every = rounded < Scalar(1)     ? 1
                   : rounded < Scalar(1e6) ? static_cast<std::int32_t>(rounded)
                                           : 1'000'000;
  const std::int32_t room = schedule.every - 3;
  const std::int32_t least = room > 0 ? (rows + room - 1) / room : rows;
  schedule.at_once = wanted == 0 || room < 1;
  schedule.rows_a_sample = wanted > least ? wanted : least;
  return schedule;
}

}  // namespace heft::detail
