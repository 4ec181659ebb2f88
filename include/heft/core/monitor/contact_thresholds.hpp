/// @file
/// How large a residual may become while nothing touches the arm.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/numeric_range.hpp"

namespace heft {

/// What the residual of a joint may depend on in free motion.
template <typename Scalar>
struct ResidualCircumstance {
  Scalar speed{0};  ///< |q̇| [rad/s, m/s]
  Scalar load{0};   ///< |torque that the model explains| [N·m, N]
  Scalar load_rate{
      0};  ///< mean |rate of that torque| of late [N·m/s, N/s]: how far off timing and inertia show
  Scalar reversal{0};   ///< e^{−t/T}, t since the joint last turned round, started or stopped
  Scalar ignorance{1};  ///< e^{−A t}, t spent in this direction: how little of the offset there is known yet
};

/// Threshold of one joint, linear in its circumstances, no coefficient below zero.
template <typename Scalar>
struct JointThreshold {
  Scalar constant{0};   ///< [N·m, N], above 0
  Scalar speed{0};      ///< [N·m·s/rad, N·s/m]
  Scalar load{0};       ///< [1]
  Scalar load_rate{0};  ///< [s]
  Scalar reversal{0};   ///< [N·m, N]
  Scalar ignorance{0};  ///< [N·m, N]
  /// Largest offset of the residual that free motion shows [N·m, N], ≥ 0; more is not taken for the model's error.
  Scalar offset_limit{0};
  Scalar rest_speed{static_cast<Scalar>(0.01)};  ///< a faster joint moves [rad/s, m/s], above 0

  /// Threshold [N·m, N].
  constexpr Scalar at(const ResidualCircumstance<Scalar>& now) const noexcept {
    return constant + speed * now.speed + load * now.load + load_rate * now.load_rate +
           reversal * now.reversal + ignorance * now.ignorance;
  }

  constexpr bool is_valid() const noexcept {
    const Scalar values[] = {speed, load, load_rate, reversal, ignorance, offset_limit};
    for (const Scalar& value : values) {
      if (!(value >= Scalar(0)) || !is_usable(value)) return false;
    }
    return constant > Scalar(0) && is_usable(constant) && rest_speed > Scalar(0) && is_usable(rest_speed);
  }

  template <typename To>
  constexpr JointThreshold<To> cast() const noexcept {
    return {static_cast<To>(constant),     static_cast<To>(speed),     static_cast<To>(load),
            static_cast<To>(load_rate),    static_cast<To>(reversal),  static_cast<To>(ignorance),
            static_cast<To>(offset_limit), static_cast<To>(rest_speed)};
  }
};

/// Thresholds of an arm with the filters that they were learnt behind; `heft export` writes one as kThresholds.
template <typename Scalar, int N>
struct ContactThresholds {
  Scalar bandwidth{25};  ///< K of MomentumObserver [1/s]
  Scalar adaptation{5};  ///< A: rate at which the residual's offset in each direction is followed [1/s]
  Scalar reversal_time{static_cast<Scalar>(0.2)};  ///< T of ResidualCircumstance::reversal [s]
  std::array<JointThreshold<Scalar>, static_cast<std::size_t>(N)> joints{};

  template <typename To>
  constexpr ContactThresholds<To, N> cast() const noexcept {
    ContactThresholds<To, N> to;
    to.bandwidth = static_cast<To>(bandwidth);
    to.adaptation = static_cast<To>(adaptation);
    to.reversal_time = static_cast<To>(reversal_time);
    for (std::size_t j = 0; j < joints.size(); ++j) to.joints[j] = joints[j].template cast<To>();
    return to;
  }
};

}  // namespace heft
