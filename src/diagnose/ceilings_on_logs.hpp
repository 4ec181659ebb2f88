/// @file
/// The ceiling of a diagnosis on its logs, and what is left by it.
#pragma once

#include <vector>

#include "heft/diagnose/diagnose.hpp"
#include "motion_scores.hpp"

namespace heft::diagnose {

/// Fills in what a diagnosis says of the residual that is left: Diagnosis::ceilings, the cause of every entry of
/// Diagnosis::unexplained, and Diagnosis::curves.
/// @param fitted  the training logs, read as the model that is written reads them
/// @param judged  the validation logs, read likewise
/// @param train   the training logs as given
void put_ceilings(const JudgedMotion& fitted, const JudgedMotion& judged, const std::vector<data::Log>& train,
                  Diagnosis& diagnosis);

}  // namespace heft::diagnose
