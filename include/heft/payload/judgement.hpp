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
#include "heft/payload/payload_run.hpp"

namespace heft::payload {

/// Torque scales of joints that differ from one another by more than this [1] matter for a load: torque constants of
/// data sheets are good to about a tenth.
inline constexpr double kScaleOff = 0.1;
/// Factor by which a joint's torque may be off before the log contradicts itself: beyond 2 it is no torque constant.
inline constexpr double kScaleImpossible = 2.0;

/// Why a load cannot be what the log says, as a sentence without a full stop; empty: nothing speaks against it. A mass
/// below zero, or a body that cannot exist, by more than the 95 % intervals allow; a joint whose torque scale is beyond
/// kScaleImpossible or negative.
std::string contradiction(const payload::PayloadRun& run);
/// Judges a load.
host::Judgement judge(const payload::PayloadRun& run);

}  // namespace heft::payload
