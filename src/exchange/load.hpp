/// @file
/// Bodies, friction and rotor inertias that can be written.
#pragma once

#include <string>

#include "heft/exchange/load_formats.hpp"

namespace heft::exchange {

/// @param where  of the message: "the load", "link \"forearm\""
/// @throws ModelError
void refuse_impossible(const Load& load, const std::string& where);
/// A friction or rotor inertia of a joint that is below zero or not finite.
/// @param what  of the message: "viscous friction"
/// @throws ModelError
void refuse_negative(const std::string& joint, const char* what, double value);

}  // namespace heft::exchange
