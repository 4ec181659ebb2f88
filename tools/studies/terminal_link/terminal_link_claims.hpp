/// @file
/// The table of claims of the reproduction, and its further requirements.
#pragma once

#include "terminal_link_study.hpp"

namespace heft::studies {

/// "A", or "B" where the torque carries the rotors' share of the acceleration noise.
const char* scenario_name(bool rotor_inertia);

/// Fills `table` and `requirements` of a study whose runs are there.
void make_claims(Study& study);

}  // namespace heft::studies
