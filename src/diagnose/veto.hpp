/// @file
/// The validation logs have a veto.
#pragma once

#include <Eigen/Core>

#include "search.hpp"

namespace heft::diagnose {

/// Takes out effects that raise the error on a validation log, or gives them another form that does not.
/// @param base  prediction of the fit without effects on the validation logs
void reject_overfitted(Search& search, const Eigen::MatrixXd& base);

}  // namespace heft::diagnose
