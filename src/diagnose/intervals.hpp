/// @file
/// Parameters of what was found, and how well they are known.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine.hpp"
#include "heft/diagnose/diagnose.hpp"

namespace heft::diagnose {

/// Parameters of an accepted effect.
/// @param c  its coefficients
void describe(const Candidate& own, const Eigen::VectorXd& c, const model::Robot& robot, Finding& finding);

/// Half widths of the 95 % intervals of the parameters of a finding; NaN where the fit does not tell.
/// @param stated  the parameters, of a fit that the prior steadies: an interval reaches as far beyond what blocks say as the fit
///                without it, at the shapes that it asks for, is away
/// @param sample  time between two samples of the logs [s]
std::vector<double> half_widths_of(const Candidate& own, std::size_t index, const std::vector<Replica>& replicas,
                                   const std::vector<std::pair<std::string, double>>& stated, double sample);

}  // namespace heft::diagnose
