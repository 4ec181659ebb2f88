/// @file
/// How far a load can be trusted, by limits stated here.
///
/// | asked of | good | doubtful | bad |
/// | --- | --- | --- | --- |
/// | an estimate with an interval | covers the truth, where that is known | does not | off by more than kFarOff intervals |
/// | a load | possible, the joints agree | torque scales differ by kScaleOff | see contradiction() |
#pragma once

#include <string>

#include "heft/host/verdict.hpp"
#include "heft/payload/payload.hpp"

namespace heft::payload {

/// Why a load cannot be what the log says, as a sentence without a full stop; empty: nothing speaks against it. A mass
/// below zero, or a body that cannot exist, by more than the 95 % intervals allow; a joint whose torque scale is beyond
/// kScaleImpossible or negative.
std::string contradiction(const payload::PayloadRun& run);
/// Judges a load.
host::Judgement judge(const payload::PayloadRun& run);

}  // namespace heft::payload
