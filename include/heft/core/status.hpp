/// @file
/// The answer of every core function that can fail.
#pragma once

#include <cstdint>

namespace heft {

/// Result of a core call. Anything but kOk leaves outputs and state as they were.
enum class [[nodiscard]] Status : std::uint8_t{
    kOk,
    kNonFiniteInput,       ///< an input is NaN, infinite, or beyond kLargestInput (numeric_range.hpp)
    kOutOfRange,           ///< a setting is outside its documented range
    kNotConfigured,        ///< configure() has not returned kOk yet
    kSingular,             ///< a pivot vanished: the step was not taken
    kNotPositiveDefinite,  ///< a matrix that must be positive definite is not
    kNotExcited            ///< the data do not determine the answer yet
};

/// Name of a status, for people. Static storage, never null.
constexpr const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::kOk: return "ok";
    case Status::kNonFiniteInput: return "non-finite input";
    case Status::kOutOfRange: return "setting out of range";
    case Status::kNotConfigured: return "not configured";
    case Status::kSingular: return "singular";
    case Status::kNotPositiveDefinite: return "not positive definite";
    case Status::kNotExcited: return "not excited";
  }
  return "unknown status";
}

}  // namespace heft
