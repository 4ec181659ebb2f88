/// @file
/// How large a number the estimators and filters of core accept.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

namespace heft {

/// Largest magnitude of an input. Sums of products of two such numbers, weighted and forgotten as the estimators do,
/// remain finite; a larger one would turn a state into infinity and then NaN, which nothing brings back.
template <typename Scalar>
inline constexpr double kLargestInput = std::is_same_v<Scalar, float> ? 1e8 : 1e70;

/// Largest variance, weight or precision that a setting may have; its inverse is the smallest.
template <typename Scalar>
inline constexpr double kLargestWeight = std::is_same_v<Scalar, float> ? 1e12 : 1e60;

namespace detail {

/// The bits of a number without its sign: in the order of magnitudes, infinity behind all numbers and NaN behind that. A
/// processor compares them without its floating-point unit: on a Cortex-M7 three instructions a number in place of ten.
constexpr std::uint32_t magnitude_bits(float value) noexcept {
  return std::bit_cast<std::uint32_t>(value) << 1;
}
constexpr std::uint64_t magnitude_bits(double value) noexcept {
  return std::bit_cast<std::uint64_t>(value) << 1;
}

}  // namespace detail

/// |value| ≤ bound; false for NaN.
/// @param bound  ≥ 0, not NaN
template <typename Scalar>
constexpr bool is_within(const Scalar& value, const Scalar& bound) noexcept {
  if constexpr (std::is_floating_point_v<Scalar>) {
    return detail::magnitude_bits(value) <= detail::magnitude_bits(bound);
  } else {
    return value <= bound && value >= -bound;
  }
}

/// Neither NaN nor infinite nor larger than kLargestInput.
template <typename Scalar>
constexpr bool is_usable(const Scalar& value) noexcept {
  return is_within(value, static_cast<Scalar>(kLargestInput<Scalar>));
}

/// Neither NaN nor infinite, for any Scalar and in constant expressions; std::isfinite is neither, and calls libm on some
/// targets.
template <typename Scalar>
constexpr bool is_finite(const Scalar& value) noexcept {
  if constexpr (std::is_floating_point_v<Scalar>) {
    return detail::magnitude_bits(value) < detail::magnitude_bits(std::numeric_limits<Scalar>::infinity());
  } else {
    return value - value == Scalar(0);
  }
}

namespace detail {

/// Entries of a vector or an array of fixed size that lies in memory; 0: not known.
template <typename Values>
constexpr std::size_t fixed_size() noexcept {
  if constexpr (requires(const Values& values) { values.data(); }) {
    if constexpr (requires { Values::SizeAtCompileTime; }) {
      return Values::SizeAtCompileTime > 0 ? static_cast<std::size_t>(Values::SizeAtCompileTime) : 0;
    } else if constexpr (requires { std::tuple_size<Values>::value; }) {
      return std::tuple_size<Values>::value;
    }
  }
  return 0;
}

}  // namespace detail

/// is_usable for all entries of a vector or an array; unrolled where it is short.
template <typename Values>
constexpr bool all_usable(const Values& values) noexcept {
  constexpr std::size_t kSize = detail::fixed_size<Values>();
  if constexpr (kSize > 0 && kSize <= 10) {
    return [&values]<std::size_t... I>(std::index_sequence<I...>) {
      return (is_usable(values.data()[I]) && ...);
    }
    (std::make_index_sequence<kSize>{});
  } else {
    for (const auto& value : values) {
      if (!is_usable(value)) {
        return false;
      }
    }
    return true;
  }
}

/// Finds the largest magnitude of some numbers. A NaN counts as larger than all of them and stays, so that one comparison at the end,
/// is_usable(largest()), answers for every number.
template <typename Scalar>
class LargestMagnitude {
 public:
  constexpr void look(const Scalar& value) noexcept {
    if constexpr (std::is_floating_point_v<Scalar>) {
      const auto bits = detail::magnitude_bits(value);
      largest_ = bits > largest_ ? bits : largest_;
    } else {
      using std::abs;
      const Scalar magnitude = abs(value);
      const bool is_number = largest_ <= largest_;
      if (is_number && !(magnitude <= largest_)) {
        largest_ = magnitude;
      }
    }
  }

  /// Of all numbers so far, 0 without any.
  constexpr Scalar largest() const noexcept {
    if constexpr (std::is_floating_point_v<Scalar>) {
      return std::bit_cast<Scalar>(largest_ >> 1);
    } else {
      return largest_;
    }
  }

 private:
  static constexpr auto nothing() noexcept {
    if constexpr (std::is_floating_point_v<Scalar>) {
      return detail::magnitude_bits(Scalar(0));
    } else {
      return Scalar(0);
    }
  }
  decltype(nothing()) largest_ = nothing();
};

/// A variance or weight: positive, and within kLargestWeight and its inverse.
template <typename Scalar>
constexpr bool is_usable_weight(const Scalar& value) noexcept {
  constexpr Scalar kLargest{static_cast<Scalar>(kLargestWeight<Scalar>)};
  constexpr Scalar kSmallest{static_cast<Scalar>(1 / kLargestWeight<Scalar>)};
  return value <= kLargest && value >= kSmallest;
}

}  // namespace heft
