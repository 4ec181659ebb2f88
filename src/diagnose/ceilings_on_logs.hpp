/// @file
/// The ceiling of a diagnosis on its logs, and what is left by it.
#pragma once

#include <vector>

#include "heft/diagnose/diagnose.hpp"
#include "motion_scores.hpp"

namespace heft::diagnose {

/// @param diagnosis  gives the models, identified and after
/// @param fitted     the training logs, read as the model that is written reads them
/// @param judged     the validation logs, read likewise
/// @return n
std::vector<Ceiling> ceilings_of(const Diagnosis& diagnosis, const JudgedMotion& fitted, const JudgedMotion& judged);

}  // namespace heft::diagnose
