/// @file
/// The reproduction of UPC-ETSEIB (2017) on the joint stiffness of the UR5 for people: reach, dexterity, stiffness from
/// the measured deflections, what does not reproduce.
#pragma once

#include <functional>

#include "study_report.hpp"

namespace heft::studies {

/// Runs the study. Seconds.
/// @param seeds     of noise, for each simulated case
/// @param progress  share done of the simulations, 0..1; may be empty
StudyReport reproduce_ur5_stiffness(int seeds, const std::function<void(double)>& progress = {});

}  // namespace heft::studies
