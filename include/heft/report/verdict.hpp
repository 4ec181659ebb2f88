/// @file
/// A verdict with its reasons, for programs that put together an answer of their own.
#pragma once

#include <string>

#include "heft/host/verdict.hpp"

namespace heft::report {

/// "Verdict: doubtful" and a line a reason; ends with a line break.
std::string verdict_text(const host::Judgement& judgement);
/// One JSON object with the fields "verdict" and "reasons".
std::string verdict_json(const host::Judgement& judgement);

}  // namespace heft::report
