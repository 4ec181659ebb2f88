/// @file
/// What is known of a load, and since when.
#pragma once

#include <array>
#include <cstdint>

#include "heft/core/arm_model.hpp"

namespace heft {

/// What is known of the load.
enum class LoadState : std::uint8_t {
  kUnknown,     ///< the motion has not shown it yet
  kChanging,    ///< another load than before, not known yet
  kNone,        ///< known to be indistinguishable from zero
  kKnown,       ///< a load that explains the torques
  kUnexplained  ///< torques that no load explains: contact, a fault, another arm than the model
};

/// Name of a state, for people.
constexpr const char* to_string(LoadState state) noexcept {
  switch (state) {
    case LoadState::kUnknown: return "unknown";
    case LoadState::kChanging: return "changing";
    case LoadState::kNone: return "none";
    case LoadState::kKnown: return "known";
    case LoadState::kUnexplained: return "unexplained";
  }
  return "unknown state";
}

/// The ten parameters of a load, each with what is known of it, about the last link frame.
template <typename Scalar>
struct LoadEstimate {
  InertialParameters<Scalar> value{};
  /// Standard deviations, the correlation of the residual in time included.
  InertialParameters<Scalar> std{};
  /// The motion has reduced the prior's standard deviation to less than a tenth. The others hold next to their prior, zero.
  std::array<bool, 10> excited{};
  LoadState state{LoadState::kUnknown};
  Scalar since{0};  ///< data count from here on [s since the first sample]
};

/// The latest change of load.
template <typename Scalar>
struct LoadChange {
  bool any{false};                ///< false: there was none
  bool declared{false};           ///< by a call, not seen in the torques
  Scalar time{0};                 ///< when it was declared or seen [s since the first sample]
  LoadEstimate<Scalar> before{};  ///< what was known at that time
};

}  // namespace heft
