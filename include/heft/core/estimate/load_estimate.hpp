/// @file
/// What is known of a load, and since when.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
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
  /// Centre of mass in the last link frame, with standard deviations [m]; 0 where the mass is below three of its own.
  std::array<Scalar, 3> com{}, com_std{};

  /// Fills in the centre of mass.
  /// @param recursion  RecursiveLeastSquares, the ten parameters first
  /// @param factor     on its variances
  template <typename Recursion>
  void add_com(const Recursion& recursion, const Scalar& factor) noexcept {
    using std::sqrt;
    const Scalar mass = value[kMass];
    if (!(mass > Scalar(3) * std[kMass])) {
      return;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      com[axis] = value[kMcx + axis] / mass;
      com_std[axis] =
          sqrt(factor * recursion.variance(kMass, -com[axis], static_cast<int>(kMcx + axis), Scalar(1))) /
          mass;
    }
  }
};

/// The latest change of load.
template <typename Scalar>
struct LoadChange {
  bool any{false};                ///< false: there was none
  bool declared{false};           ///< by a call, not seen in the torques
  Scalar time{0};                 ///< when it was declared or seen [s since the first sample]
  LoadEstimate<Scalar> before{};  ///< what was known at that time
};

/// What a model explains of the torque between two samples: its torque at the motion half-way, whose acceleration is the
/// difference of the two velocities over the period.
template <typename Scalar, int N>
struct ExplainedTorque {
  bool valid{false};
  JointVector<Scalar, N> qd = JointVector<Scalar, N>::Zero();      ///< half-way [rad/s, m/s]
  JointVector<Scalar, N> torque = JointVector<Scalar, N>::Zero();  ///< of the model there [N·m, N]
  Scalar period{0};  ///< between the two, refused samples in between included [s]
};

}  // namespace heft
