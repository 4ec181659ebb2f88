/// @file
/// The UR5 of the study on its stiffness.
#pragma once

#include "../../tools/studies/ur5_stiffness/thesis_ur5.hpp"

namespace heft::test {

inline model::Robot thesis_ur5() { return studies::make_thesis_ur5(); }

}  // namespace heft::test
