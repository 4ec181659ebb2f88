/// @file
/// Descriptions of arms in another precision, at compile time: an image in single precision then holds no double arithmetic.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "heft/core/arm_model.hpp"
#include "heft/core/effects/cable.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/effects/elasticity.hpp"
#include "heft/core/friction/gear_coupling.hpp"

namespace heft {

template <typename To, typename From, std::size_t kCount>
constexpr std::array<To, kCount> converted(const std::array<From, kCount>& values) noexcept {
  std::array<To, kCount> out{};
  for (std::size_t i = 0; i < kCount; ++i) {
    out[i] = static_cast<To>(values[i]);
  }
  return out;
}

template <typename To, typename From>
constexpr JointActuation<To> converted(const JointActuation<From>& a) noexcept {
  return {static_cast<To>(a.rotor_inertia), static_cast<To>(a.coulomb_friction),
          static_cast<To>(a.viscous_friction), static_cast<To>(a.friction_offset)};
}

template <typename To, typename From, int N>
constexpr ArmModel<To, N> converted(const ArmModel<From, N>& arm) noexcept {
  ArmModel<To, N> out;
  for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
    out.joints[j].type = arm.joints[j].type;
    out.joints[j].rotation = converted<To>(arm.joints[j].rotation);
    out.joints[j].position = converted<To>(arm.joints[j].position);
    out.joints[j].axis = converted<To>(arm.joints[j].axis);
    out.links[j] = converted<To>(arm.links[j]);
    out.actuation[j] = converted<To>(arm.actuation[j]);
  }
  out.gravity = converted<To>(arm.gravity);
  return out;
}

template <typename To, typename From>
constexpr GearCoupling<To> converted(const GearCoupling<From>& c) noexcept {
  return {c.driving,
          c.driven,
          static_cast<To>(c.ratio),
          static_cast<To>(c.rotor_inertia),
          static_cast<To>(c.coulomb_friction),
          static_cast<To>(c.viscous_friction)};
}

/// An interval; what has no limit keeps none.
template <typename To, typename From>
constexpr SeenInterval<To> converted(const SeenInterval<From>& interval) noexcept {
  SeenInterval<To> out;
  if (interval.low > std::numeric_limits<From>::lowest()) out.low = static_cast<To>(interval.low);
  if (interval.high < std::numeric_limits<From>::max()) out.high = static_cast<To>(interval.high);
  return out;
}

template <typename To, typename From>
constexpr SeenWithin<To> converted(const SeenWithin<From>& seen) noexcept {
  return {converted<To>(seen.velocity), converted<To>(seen.load), converted<To>(seen.position),
          converted<To>(seen.temperature)};
}

template <typename To, typename From>
constexpr JointEffect<To> converted(const JointEffect<From>& effect) noexcept {
  JointEffect<To> out;
  out.kind = effect.kind;
  out.joint = effect.joint;
  out.parameters = converted<To>(effect.parameters);
  out.displacement = effect.displacement;
  out.seen = converted<To>(effect.seen);
  return out;
}

template <typename To, typename From>
constexpr JointCable<To> converted(const JointCable<From>& c) noexcept {
  return {c.driving,
          c.driven,
          static_cast<To>(c.ratio),
          static_cast<To>(c.stiffness),
          static_cast<To>(c.neutral),
          converted<To>(c.seen)};
}

template <typename To, typename From>
constexpr Elasticity<To> converted(const Elasticity<From>& e) noexcept {
  return {e.joint, static_cast<To>(e.stiffness), static_cast<To>(e.damping),
          static_cast<To>(e.motor_inertia), static_cast<To>(e.gap)};
}

/// The same of each entry.
template <typename To, template <typename> typename Entry, typename From, std::size_t kCount>
constexpr std::array<Entry<To>, kCount> converted_all(
    const std::array<Entry<From>, kCount>& entries) noexcept {
  std::array<Entry<To>, kCount> out{};
  for (std::size_t i = 0; i < kCount; ++i) {
    out[i] = converted<To>(entries[i]);
  }
  return out;
}

}  // namespace heft
