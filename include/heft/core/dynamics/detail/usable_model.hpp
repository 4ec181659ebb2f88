/// @file
/// Whether the numbers of an arm model are numbers.
#pragma once

#include <cstddef>

#include "heft/core/arm_model.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft::detail {

/// Joints, links, rotors, friction and gravity, all within kLargestInput.
template <typename Scalar, int N>
bool is_usable_model(const ArmModel<Scalar, N>& arm) noexcept {
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    const Joint<Scalar>& joint = arm.joints[i];
    const JointActuation<Scalar>& drive = arm.actuation[i];
    if (!all_usable(joint.rotation) || !all_usable(joint.position) || !all_usable(joint.axis) ||
        !all_usable(arm.links[i]) || !is_usable(drive.rotor_inertia) || !is_usable(drive.coulomb_friction) ||
        !is_usable(drive.viscous_friction) || !is_usable(drive.friction_offset)) {
      return false;
    }
  }
  return all_usable(arm.gravity);
}

}  // namespace heft::detail
