/// @file
/// Whether what several logs, or several joints of one log, show is the same.
#pragma once

#include <cstddef>
#include <vector>

#include "heft/stiffness/joint_encoders.hpp"

namespace heft::stiffness {

/// Whether the logs agree on the stiffness of joint j of those fitted.
/// @param separate  a fit of each log, at least two
StiffnessAgreement compare(const std::vector<std::vector<JointStiffness>>& separate, std::size_t j);

/// The delay of the link's channel that the joints of a log share.
CommonTimeShift common_shift(const std::vector<JointStiffness>& fits);

}  // namespace heft::stiffness
