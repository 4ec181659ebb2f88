/// @file
/// How large a number the estimators and filters of core accept.
#pragma once

#include <type_traits>

namespace heft {

/// Largest magnitude of an input. Sums of products of two such numbers, weighted and forgotten as the estimators do,
/// remain finite; a larger one would turn a state into infinity and then NaN, which nothing brings back.
template <typename Scalar>
inline constexpr double kLargestInput = std::is_same_v<Scalar, float> ? 1e8 : 1e70;

/// Largest variance, weight or precision that a setting may have; its inverse is the smallest.
template <typename Scalar>
inline constexpr double kLargestWeight = std::is_same_v<Scalar, float> ? 1e12 : 1e60;

/// Neither NaN nor infinite nor larger than kLargestInput. Two comparisons.
template <typename Scalar>
constexpr bool is_usable(const Scalar& value) noexcept {
  constexpr Scalar kLargest{static_cast<Scalar>(kLargestInput<Scalar>)};
  constexpr Scalar kSmallest{static_cast<Scalar>(-kLargestInput<Scalar>)};
  return value <= kLargest && value >= kSmallest;
}

/// Neither NaN nor infinite. A subtraction and a comparison, for any Scalar and in constant expressions; std::isfinite is
/// neither, and calls libm on some targets. Not for code under -ffast-math, which removes it.
template <typename Scalar>
constexpr bool is_finite(const Scalar& value) noexcept {
  return value - value == Scalar(0);
}

/// is_usable for all entries of a vector or an array.
template <typename Values>
constexpr bool all_usable(const Values& values) noexcept {
  for (const auto& value : values) {
    if (!is_usable(value)) {
      return false;
    }
  }
  return true;
}

/// A variance or weight: positive, and within kLargestWeight and its inverse.
template <typename Scalar>
constexpr bool is_usable_weight(const Scalar& value) noexcept {
  constexpr Scalar kLargest{static_cast<Scalar>(kLargestWeight<Scalar>)};
  constexpr Scalar kSmallest{static_cast<Scalar>(1 / kLargestWeight<Scalar>)};
  return value <= kLargest && value >= kSmallest;
}

}  // namespace heft
