/// @file
/// How far stiffnesses can be trusted.
#pragma once

#include "heft/host/verdict.hpp"
#include "heft/stiffness/joint_encoders.hpp"
#include "heft/stiffness/deflection_fit.hpp"
#include "heft/stiffness/stiffness_effects.hpp"

namespace heft::stiffness {

/// Ratio of the ends of a stiffness' interval from which on it is an order of magnitude rather than a figure.
inline constexpr double kWideStiffness = 4.0;

/// Judges stiffnesses from deflections.
host::Judgement judge(const stiffness::StiffnessFit& fit, const stiffness::StiffnessDiagnosis& diagnosis);
/// Judges stiffnesses from encoders.
/// @param rotor_inertia_known  what the rotors take of the torque was subtracted
host::Judgement judge(const stiffness::JointEncoderFit& fit, bool rotor_inertia_known);

}  // namespace heft::stiffness
