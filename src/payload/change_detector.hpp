/// @file
/// Cumulative sums of innovations: has the load changed?
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace heft::payload {

/// Two-sided cumulative sum (Page's test) of the normalised innovation z of each joint, over time rather
/// than samples: g ← max(0, g ± (z ∓ kDrift) dt). Slow model error stays below the drift; what lies above
/// it must last.
///
/// z is first divided by its own running scatter where that exceeds one: a model that fits this log less
/// well than the one it was made from raises no alarm. Clipped and slow, the scatter does not follow a
/// change before it is called.
///
/// Levels from measured logs: without a change |z| exceeds 3 in stretches of some tenths of a second, at
/// most to 10; a load of 10 % of the wrist's torque range gives 5 to 30 for as long as it is there.
template <int N>
class ChangeDetector {
 public:
  static constexpr double kDrift = 3.0;
  static constexpr double kLargest = 10.0;   ///< a single outlier must not suffice
  static constexpr double kThreshold = 2.5;  ///< [s]
  static constexpr double kLargestInScatter = 5.0;
  static constexpr double kScatterTime = 20.0;  ///< of the running scatter [s]

  /// Forgets the sums; what is known of the scatter stays.
  void reset() {
    for (Joint& joint : joints_) joint.sums = {};
  }

  /// @param z  normalised innovation of joint i, which moves
  /// @return true: alarm; since() says when it began
  bool take(int i, double z, double time, double period) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    const double scaled = z / std::sqrt(std::max(1.0, joint.scatter));
    const double clipped = std::min(z * z, kLargestInScatter * kLargestInScatter);
    joint.scatter += (clipped - joint.scatter) * std::min(1.0, period / kScatterTime);
    bool alarm = false;
    for (std::size_t side = 0; side < 2; ++side) {
      Sum& sum = joint.sums[side];
      const double pull = std::clamp(side == 0 ? scaled : -scaled, -kLargest, kLargest) - kDrift;
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
  void rest(int i) { joints_[static_cast<std::size_t>(i)].sums = {}; }

  double since() const { return since_; }

 private:
  struct Sum {
    double value{0.0};
    double since{0.0};
  };
  struct Joint {
    std::array<Sum, 2> sums{};
    double scatter{1.0};  ///< running mean of z²
  };
  std::array<Joint, static_cast<std::size_t>(N)> joints_{};
  double since_{0.0};
};

}  // namespace heft::payload
