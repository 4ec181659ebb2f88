/// @file
/// The UR5 as a Denavit-Hartenberg table: table 3 of UPC-ETSEIB (2017) [m].
#pragma once

#include "heft/model/kinematics.hpp"

namespace heft::studies {

inline model::Robot ur5_of_dh_table() {
  return model::make_standard_dh_robot("ur5 (table 3)", {{0.0, 0.08916, 1.0, 0.0},
                                                         {-0.425, 0.0, 0.0, 1.0},
                                                         {-0.39225, 0.0, 0.0, 1.0},
                                                         {0.0, 0.10915, 1.0, 0.0},
                                                         {0.0, 0.09465, -1.0, 0.0},
                                                         {0.0, 0.0823, 0.0, 1.0}});
}

}  // namespace heft::studies
