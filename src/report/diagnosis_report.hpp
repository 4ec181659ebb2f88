/// @file
/// The page of a diagnosis.
#pragma once

#include "diagnosis_result.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Verdict, ranking, residuals of the joints that have something to tell, errors before and after, refusals.
page::Page diagnosis_page(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context);

}  // namespace heft::report
