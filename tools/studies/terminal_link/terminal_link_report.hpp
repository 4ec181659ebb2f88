/// @file
/// The reproduction of Kawasaki and Nishimura (1984) for people: open loop, instruments, identifiability, closed loop.
#pragma once

#include <functional>

#include "study_report.hpp"

namespace heft::studies {

/// Runs the study and says what holds. About half a minute on two processors.
/// @param seeds     of noise, for each simulated case
/// @param progress  share done of the protocol, 0..1; may be empty
StudyReport reproduce_terminal_link(int seeds, const std::function<void(double)>& progress = {});

}  // namespace heft::studies
