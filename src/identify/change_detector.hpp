/// @file
/// Cumulative sums of innovations: has the load changed?
#pragma once

#include <algorithm>
#include <array>

namespace heft::identify {

/// Two-sided cumulative sum (Page's test) of the normalised innovation z of each joint, over time rather than samples:
/// g ← max(0, g ± (z ∓ kDrift) dt). Slow model error stays below the drift; what lies above it must last.
///
/// Levels from the measured logs at hand: without a change |z| exceeds 3 in stretches of some tenths of a second, at
/// most to 10; a load of 10 % of the wrist's torque range gives 5 to 30 for as long as it is there.
template <int N>
class ChangeDetector {
 public:
  static constexpr double kDrift = 3.0;
  static constexpr double kLargest = 10.0;  ///< a single outlier must not suffice
  static constexpr double kThreshold = 2.5; ///< [s]

  void reset() {
    for (auto& joint : sums_) joint = {};
  }

  /// @param z  normalised innovation of joint i, which moves
  /// @return true: alarm; since() tells when it began
  bool take(int i, double z, double time, double period) {
    bool alarm = false;
    for (std::size_t side = 0; side < 2; ++side) {
      Sum& sum = sums_[static_cast<std::size_t>(i)][side];
      const double pull = std::clamp(side == 0 ? z : -z, -kLargest, kLargest) - kDrift;
      if (sum.value == 0.0) sum.since = time;
      sum.value = std::max(0.0, sum.value + pull * period);
      if (sum.value > kThreshold) {
        since_ = alarm ? std::min(since_, sum.since) : sum.since;
        alarm = true;
      }
    }
    return alarm;
  }

  /// Joint i came to rest: what it said is forgotten.
  void rest(int i) { sums_[static_cast<std::size_t>(i)] = {}; }

  double since() const { return since_; }

 private:
  struct Sum {
    double value{0.0};
    double since{0.0};
  };
  std::array<std::array<Sum, 2>, static_cast<std::size_t>(N)> sums_{};
  double since_{0.0};
};

}  // namespace heft::identify
