/// @file
/// The UR5 of the study on its stiffness.
#pragma once

#include "../../tools/studies/ur5_stiffness/ur5_dh_table.hpp"

namespace heft::test {

inline model::Robot ur5_of_dh_table() { return studies::ur5_of_dh_table(); }

}  // namespace heft::test
