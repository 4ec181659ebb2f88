/// @file
/// How far a fit can be trusted: see validate/judgement.hpp for the limits.
#pragma once

#include <vector>

#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/validate/score.hpp"

namespace heft::identify {

/// Judges a fit.
/// @param held_out  one score a log that the fit has not seen; empty: it was judged on nothing, which is doubtful
/// @param training  looked at where held_out is empty
host::Judgement judge(const Fit& fit, const model::MassMatrixCheck& mass,
                      const std::vector<validate::Score>& held_out,
                      const std::vector<validate::Score>& training = {});

}  // namespace heft::identify
