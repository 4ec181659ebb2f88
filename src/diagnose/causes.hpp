/// @file
/// Where a structure comes from that no known effect explains: missing physics, or noise of the measurement?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/diagnose/diagnose.hpp"

namespace heft::diagnose {

/// Rms torque error that the encoders' steps cause: the motion that the model was fitted to, with positions rounded to
/// these steps and read as a log is, against the same motion as it is. n [N·m, N]
/// @param robot   the fitted model
/// @param motion  smooth: as the traces of a log have it
/// @param cutoff  of the low-pass on q [Hz]
Eigen::VectorXd quantisation_error(const model::Robot& robot, const Traces& motion,
                                   const Eigen::VectorXd& steps, double cutoff);

/// Gives every entry of Diagnosis::unexplained its cause, by Diagnosis::ceilings, the line in its spectrum and the steps
/// of the encoders, and says so in its words.
/// @param train  the logs that the model was fitted to
void name_causes(const std::vector<data::Log>& train, Diagnosis& diagnosis);

}  // namespace heft::diagnose
