// Explicit instantiations for the sizes most arms have: errors show when core is built, and the archive has something
// for the symbol gate to look at. Other sizes are instantiated where they are used.
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/lumped_regressor.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/kinematics/geometric_jacobian.hpp"
#include "heft/core/kinematics/joint_deflection.hpp"

namespace heft {

#define HEFT_INSTANTIATE(Scalar, N)                                                                          \
  template class DynamicArm<Scalar, N>;                                                                      \
  template class JointFeedback<Scalar, N>;                                                                   \
  template class PayloadEstimator<Scalar, N>;                                                                \
  template class JointAccelerationModel<Scalar, N>;                                                          \
  template class StateVariableFilter<Scalar, N>;                                                             \
  template JointVector<Scalar, N> inverse_dynamics(                                                          \
      const DynamicArm<Scalar, N>&, const JointVector<Scalar, N>&, const JointVector<Scalar, N>&,            \
      const JointVector<Scalar, N>&) noexcept;                                                               \
  template void mass_matrix(const DynamicArm<Scalar, N>&, const JointTrigonometry<DynamicArm<Scalar, N>>&,   \
                            const JointVector<Scalar, N>&, MassMatrix<Scalar, N>&) noexcept;                 \
  template void full_regressor(const DynamicArm<Scalar, N>&, const JointVector<Scalar, N>&,                  \
                               const JointVector<Scalar, N>&, const JointVector<Scalar, N>&, Scalar,         \
                               FullRegressor<Scalar, N>&) noexcept;                                          \
  template ChainKinematics<Scalar, N> chain_kinematics(const ArmModel<Scalar, N>&, const ToolFrame<Scalar>&, \
                                                       const Eigen::Matrix<Scalar, N, 1>&) noexcept;         \
  template GeometricJacobian<Scalar, N> geometric_jacobian(const ChainKinematics<Scalar, N>&) noexcept;      \
  template Eigen::Matrix<Scalar, N, N> complementary_stiffness(                                              \
      const ChainKinematics<Scalar, N>&, const ToolWrench<Scalar>&, WrenchFrame) noexcept;                   \
  template Eigen::Matrix<Scalar, 6, 6> cartesian_compliance(const GeometricJacobian<Scalar, N>&,             \
                                                            const Eigen::Matrix<Scalar, N, 1>&) noexcept;    \
  template Status compensated_command(                                                                       \
      const Eigen::Matrix<Scalar, N, 1>&, const Eigen::Matrix<Scalar, N, 1>&,                                \
      const Eigen::Matrix<Scalar, N, 1>&, Eigen::Matrix<Scalar, N, 1>&) noexcept

HEFT_INSTANTIATE(float, 6);
HEFT_INSTANTIATE(float, 7);
HEFT_INSTANTIATE(double, 6);
HEFT_INSTANTIATE(double, 7);

}  // namespace heft
