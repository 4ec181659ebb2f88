/// @file
/// The UR5 as a Denavit-Hartenberg table.
#pragma once

#include "heft/model/kinematics.hpp"

namespace heft::test {

/// Table 3 of "Experimental identification of the joints stiffness of the UR5 robot arm", thesis, UPC-ETSEIB, 2017, in m.
inline model::Robot thesis_ur5() {
  return model::make_standard_dh_robot("ur5", {{0, 0.08916, 1, 0},
                                               {-0.425, 0, 0, 1},
                                               {-0.39225, 0, 0, 1},
                                               {0, 0.10915, 1, 0},
                                               {0, 0.09465, -1, 0},
                                               {0, 0.0823, 0, 1}});
}

}  // namespace heft::test
