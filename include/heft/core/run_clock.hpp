/// @file
/// Time since the start of a run, as a sum of sample times that goes on in single precision.
#pragma once

#include <cstdint>

#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Longest time between two samples of a run [s].
inline constexpr double kLongestStep = 1e6;

/// Whether time may go on by dt [s].
/// @param started  false: dt is that of a first sample, which is not used and need only be a number
/// @param longest  [s]
/// @return kNonFiniteInput; kOutOfRange: time stands, goes backwards or jumps
template <typename Scalar>
constexpr Status check_step(const Scalar& dt, bool started = true,
                            const Scalar& longest = static_cast<Scalar>(kLongestStep)) noexcept {
  if (!is_finite(dt)) {
    return Status::kNonFiniteInput;
  }
  return !started || (dt > Scalar(0) && dt <= longest) ? Status::kOk : Status::kOutOfRange;
}

/// Whole seconds as a whole number and the rest as a Scalar: a float of seconds alone stops after some hours at 1 kHz,
/// when a sample time has become smaller than its last digit. Rounding of the sums leaves 1e-5 of the time at 1 kHz, which is
/// what a quartz leaves.
template <typename Scalar>
class RunClock {
 public:
  void reset() noexcept { *this = RunClock{}; }

  /// @param dt  ≥ 0 and finite, at most 1e6 [s]
  void advance(Scalar dt) noexcept {
    rest_ += dt;
    if (rest_ >= Scalar(1)) {
      const auto whole = static_cast<std::uint32_t>(rest_);
      seconds_ += whole;
      rest_ -= static_cast<Scalar>(whole);
    }
  }

  /// [s], to the last digit of Scalar.
  Scalar seconds() const noexcept { return static_cast<Scalar>(seconds_) + rest_; }

 private:
  std::uint32_t seconds_{0};  ///< enough for 136 years
  Scalar rest_{0};            ///< below 1
};

}  // namespace heft
