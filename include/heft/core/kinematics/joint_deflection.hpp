/// @file
/// Deflection of an elastic joint under torque, and the command that compensates for it.
#pragma once

#include <Eigen/Core>

#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Deflection of elastic joints δ_i = τ_i / k_i (65).
///
/// The sign is that of the torque. With the torque a wrench puts on the joints (joint_torque) the answer is
/// how far the links go; with the torque the drives deliver it is how far the motors are ahead of the links,
/// θ - x (heft/core/effects/elasticity.hpp).
///
/// @param torque      n [N·m; N on a prismatic joint]
/// @param stiffness   n, positive, infinite for a rigid joint [N·m/rad; N/m]
/// @param deflection  n [rad; m]
/// @return kOutOfRange where a stiffness is not above zero, kNonFiniteInput where a torque is not finite or a
///         stiffness is NaN; the deflection is then left alone
/// Cost: one division a joint.
template <typename Scalar, int N>
Status joint_deflection(const Eigen::Matrix<Scalar, N, 1>& torque,
                        const Eigen::Matrix<Scalar, N, 1>& stiffness,
                        Eigen::Matrix<Scalar, N, 1>& deflection) noexcept {
  for (int j = 0; j < N; ++j) {
    if (!is_finite(torque[j]) || !(stiffness[j] == stiffness[j])) {
      return Status::kNonFiniteInput;
    }
    if (!(stiffness[j] > Scalar(0))) {
      return Status::kOutOfRange;
    }
  }
  for (int j = 0; j < N; ++j) {
    deflection[j] = torque[j] / stiffness[j];
  }
  return Status::kOk;
}

/// Motor-side command that brings the links where they should be: q_cmd = q_des + τ / k.
///
/// Where encoders sit on the motors, the controller holds θ = q_cmd, and the link is at x = θ - τ / k.
/// With the torque taken at the wanted pose, τ(q_des), the link is there exactly; nothing is linearised.
///
/// @param desired    n, where the links should be [rad; m]
/// @param torque     n, what the drives have to deliver through the gears with the links there, along
///                   positive q: the gravity torque of arm and payload, less Jᵀ w of a wrench from outside;
///                   while moving, the inverse dynamics of the links, and not friction or inertia of the
///                   motor side
/// @param stiffness  n, as in joint_deflection
/// @param command    n, for the motor-side position controllers [rad; m]
/// @return as joint_deflection; kNonFiniteInput for a desired position too; the command is then left alone
template <typename Scalar, int N>
Status compensated_command(const Eigen::Matrix<Scalar, N, 1>& desired,
                           const Eigen::Matrix<Scalar, N, 1>& torque,
                           const Eigen::Matrix<Scalar, N, 1>& stiffness,
                           Eigen::Matrix<Scalar, N, 1>& command) noexcept {
  for (int j = 0; j < N; ++j) {
    if (!is_finite(desired[j])) {
      return Status::kNonFiniteInput;
    }
  }
  Eigen::Matrix<Scalar, N, 1> deflection;
  if (const Status status = joint_deflection<Scalar, N>(torque, stiffness, deflection);
      status != Status::kOk) {
    return status;
  }
  for (int j = 0; j < N; ++j) {
    command[j] = desired[j] + deflection[j];
  }
  return Status::kOk;
}

}  // namespace heft
