/// @file
/// What one joint can do, as far as a reader of logs needs to know it.
#pragma once

#include <limits>

#include "heft/core/arm_model.hpp"

namespace heft {

/// Kind and limits of one joint; infinite: no limit.
struct JointSpec {
  JointType type{JointType::kRevolute};
  double lower{-std::numeric_limits<double>::infinity()};  ///< position limits [rad, m]
  double upper{std::numeric_limits<double>::infinity()};
  double velocity{std::numeric_limits<double>::infinity()};  ///< limit [rad/s, m/s]
  double effort{std::numeric_limits<double>::infinity()};    ///< limit [N·m, N]
};

}  // namespace heft
