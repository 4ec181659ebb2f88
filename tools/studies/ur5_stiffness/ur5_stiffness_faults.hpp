/// @file
/// Parts of find_faults: claims of the publication that its own numbers do not support.
#pragma once

#include <vector>

#include "ur5_stiffness_study.hpp"

namespace heft::studies {

/// Tables 6 to 19 against one another.
std::vector<Fault> faults_of_readings(const Ur5Measurements& m);
/// The load (135) against the poses of table 6.
std::vector<Fault> faults_of_load(const model::Kinematics& kinematics, const StiffnessStudy& stiffness);
/// What these poses and this load say of the joints.
std::vector<Fault> faults_of_stiffness(const model::Kinematics& kinematics,
                                       const Ur5Measurements& measurements, const StiffnessStudy& stiffness);
std::vector<Fault> faults_of_dexterity(const ReachStudy& reach, const DexterityStudy& dexterity);
std::vector<Fault> slips_of_formulas(const StiffnessStudy& stiffness);

}  // namespace heft::studies
