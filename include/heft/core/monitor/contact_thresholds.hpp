/// @file
/// How large a residual may become while nothing touches the arm.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "heft/core/numeric_range.hpp"

namespace heft {

/// What a joint does, as far as its friction is concerned.
enum class MotionPhase : std::uint8_t {
  kRest,     ///< friction holds any torque up to its limit
  kTurning,  ///< slow, or started, stopped or turned round of late: friction changes sign or level
  kMoving    ///< friction is known but for an offset
};

/// Thresholds of one joint in each phase: for the residual itself, and for its change, which is what it differs by from its
/// own mean of late.
template <typename Scalar>
struct JointThreshold {
  Scalar moving{0};                              ///< of the residual [N·m, N], above 0
  Scalar turning{0};                             ///< [N·m, N], above 0
  Scalar rest{0};                                ///< [N·m, N], above 0
  Scalar moving_change{0};                       ///< of the change [N·m, N], above 0
  Scalar turning_change{0};                      ///< [N·m, N], above 0
  Scalar rest_change{0};                         ///< [N·m, N], above 0
  Scalar rest_speed{static_cast<Scalar>(0.01)};  ///< a faster joint moves [rad/s, m/s], above 0
  /// Fastest motion that the thresholds are known for; beyond it they grow in proportion [rad/s, m/s], above 0.
  Scalar top_speed{1000};

  /// The same in every phase: `change`, and for the residual what friction may hold besides.
  static constexpr JointThreshold uniform(Scalar change, Scalar friction) noexcept {
    const Scalar level = change + friction;
    return {level, level, level, change, change, change, static_cast<Scalar>(0.01), Scalar(1000)};
  }

  constexpr bool is_valid() const noexcept {
    for (const Scalar& value :
         {moving, turning, rest, moving_change, turning_change, rest_change, rest_speed, top_speed}) {
      if (!(value > Scalar(0)) || !is_usable(value)) return false;
    }
    return true;
  }

  template <typename To>
  constexpr JointThreshold<To> cast() const noexcept {
    return {static_cast<To>(moving),        static_cast<To>(turning),        static_cast<To>(rest),
            static_cast<To>(moving_change), static_cast<To>(turning_change), static_cast<To>(rest_change),
            static_cast<To>(rest_speed),    static_cast<To>(top_speed)};
  }
};

/// Thresholds of an arm with the filters that they were learnt behind; `heft export` writes one as kThresholds.
template <typename Scalar, int N>
struct ContactThresholds {
  Scalar bandwidth{25};  ///< K of the low-pass on the torque from outside [1/s]
  Scalar adaptation{
      10};  ///< A: rate at which the mean that changes are measured from follows the residual [1/s]
  Scalar turning_time{
      static_cast<Scalar>(0.2)};  ///< how long a joint turns after it has changed direction [s]
  /// Sum over the joints of the mean |rate| of the torque that the model explains, in the harshest free motion; beyond it
  /// thresholds grow in proportion: a hard stop shakes all joints [N·m/s, N/s], above 0.
  Scalar load_rate{static_cast<Scalar>(1e6)};
  /// A single sample counts as if it differed from the residual by at most that many thresholds of its change: no glitch
  /// exceeds a threshold on its own. 1e-3 to 1000.
  Scalar largest_step{static_cast<Scalar>(2.5)};
  std::array<JointThreshold<Scalar>, static_cast<std::size_t>(N)> joints{};

  constexpr bool is_valid() const noexcept {
    const auto within = [](Scalar value, Scalar low, Scalar high) { return value >= low && value <= high; };
    for (const JointThreshold<Scalar>& joint : joints) {
      if (!joint.is_valid()) return false;
    }
    return within(bandwidth, static_cast<Scalar>(1e-3), static_cast<Scalar>(1e5)) &&
           within(adaptation, static_cast<Scalar>(1e-3), Scalar(1000)) &&
           within(turning_time, Scalar(0), Scalar(1000)) && load_rate > Scalar(0) && is_usable(load_rate) &&
           within(largest_step, static_cast<Scalar>(1e-3), Scalar(1000));
  }

  template <typename To>
  constexpr ContactThresholds<To, N> cast() const noexcept {
    ContactThresholds<To, N> to;
    to.bandwidth = static_cast<To>(bandwidth);
    to.adaptation = static_cast<To>(adaptation);
    to.turning_time = static_cast<To>(turning_time);
    to.load_rate = static_cast<To>(load_rate);
    to.largest_step = static_cast<To>(largest_step);
    for (std::size_t j = 0; j < joints.size(); ++j) to.joints[j] = joints[j].template cast<To>();
    return to;
  }
};

}  // namespace heft
