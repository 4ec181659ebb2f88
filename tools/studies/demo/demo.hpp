/// @file
/// The demo: an arm on a path picks up an unknown load, weighs it and carries on.
#pragma once

#include <functional>

#include "heft/host/verdict.hpp"
#include "study_report.hpp"

namespace heft::studies {

/// Simulates the arm without and with the estimate of its load. A few seconds.
/// @param mass      of the load [kg]
/// @param progress  share done, 0..1; may be empty
StudyReport run_demo(double mass, const std::function<void(double)>& progress = {});

}  // namespace heft::studies
