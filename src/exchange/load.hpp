/// @file
/// Bodies that can be written.
#pragma once

#include <string>

#include "heft/exchange/load_formats.hpp"

namespace heft::exchange {

/// @param where  of the message: "the load", "link \"forearm\""
/// @throws ModelError
void refuse_impossible(const Load& load, const std::string& where);

}  // namespace heft::exchange
