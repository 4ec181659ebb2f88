/// @file
/// Core's recursions for arms that are known at run time only, compiled once for 1 to kMaxJoints joints. Without this each
/// file that uses them has its copy, and the linker takes any, whatever its optimisation.
#pragma once

#include <Eigen/Core>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/loaded_torque.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/model/dynamics.hpp"

#define HEFT_SIZED_MOTION(N)                                                                                       \
  const DynamicArm<double, N>&, const JointTrigonometry<DynamicArm<double, N>>&, const JointVector<double, N>&,    \
      const JointVector<double, N>&, const JointVector<double, N>&
#define HEFT_SIZED_DYNAMICS(N, ...)                                                                                \
  __VA_ARGS__ template void inverse_dynamics(HEFT_SIZED_MOTION(N), JointVector<double, N>&) noexcept;              \
  __VA_ARGS__ template void loaded_torque(HEFT_SIZED_MOTION(N), const InertialParameters<double>&,                 \
                                          JointVector<double, N>&, JointVector<double, N>&) noexcept;              \
  __VA_ARGS__ template void last_link_regressor(HEFT_SIZED_MOTION(N),                                              \
                                                Eigen::Matrix<double, N, kParametersPerLink>&) noexcept;           \
  __VA_ARGS__ template void mass_matrix(const DynamicArm<double, N>&, const JointTrigonometry<DynamicArm<double, N>>&, \
                                        const JointVector<double, N>&, MassMatrix<double, N>&) noexcept;
/// @param ...  extern, to declare them
#define HEFT_DYNAMICS_OF_ALL_SIZES(...)                                                                        \
  HEFT_SIZED_DYNAMICS(1, __VA_ARGS__) HEFT_SIZED_DYNAMICS(2, __VA_ARGS__) HEFT_SIZED_DYNAMICS(3, __VA_ARGS__)  \
  HEFT_SIZED_DYNAMICS(4, __VA_ARGS__) HEFT_SIZED_DYNAMICS(5, __VA_ARGS__) HEFT_SIZED_DYNAMICS(6, __VA_ARGS__)  \
  HEFT_SIZED_DYNAMICS(7, __VA_ARGS__) HEFT_SIZED_DYNAMICS(8, __VA_ARGS__) HEFT_SIZED_DYNAMICS(9, __VA_ARGS__)  \
  HEFT_SIZED_DYNAMICS(10, __VA_ARGS__)

namespace heft {
static_assert(model::kMaxJoints == 10);
HEFT_DYNAMICS_OF_ALL_SIZES(extern)
}  // namespace heft
