/// @file
/// In the place of a description: an arm that is known at run time only.
#pragma once

namespace heft {

/// For ArmTorque and LoadObserver, which then take an ArmModel in configure() and the rest in add().
/// @tparam N  number of joints
/// @tparam MaxEffects, MaxCouplings  room for joint effects, and for gear couplings and as many cables
template <int N, int MaxEffects = 16, int MaxCouplings = 2>
struct RunTimeArm {};

}  // namespace heft
