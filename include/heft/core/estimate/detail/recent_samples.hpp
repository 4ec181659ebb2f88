/// @file
/// What an observer keeps of the samples that came last.
#pragma once

#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/estimate/detail/friction_doubt.hpp"
#include "heft/core/estimate/detail/sample_faults.hpp"
#include "heft/core/filter/kept_decay.hpp"
#include "heft/core/filter/state_variable_filter.hpp"

namespace heft::detail {

/// Copied before each sample, for the way back when it is refused: small.
template <typename Scalar, int N>
struct RecentSamples {
  using Vector = JointVector<Scalar, N>;

  StateVariableFilter<Scalar, N> motion, torque;
  SampleFaults<Scalar, N> faults;
  FrictionDoubt<Scalar, N> doubt;
  Vector previous_q = Vector::Zero(), previous_qd = Vector::Zero();
  KeptDecay<Scalar> forgetting;
  Scalar settling{0};  ///< left to wait [s]
  Scalar rest{0};      ///< all joints have been slow for so long [s]
  std::int32_t until_update{1};
  bool started{false};
};

}  // namespace heft::detail
