/// @file
/// Words for a parameter that differs between models.
#pragma once

#include <string>

#include "heft/compare/compare.hpp"

namespace heft::report {

/// "Coulomb friction", "mcx2* (mcx2 + 0.425 m3)".
std::string quantity(const compare::Change& change);

/// "+41 %"; empty where the value before is within its own change of 0.
std::string percent(const compare::Change& change);

/// "joint 2" or "link 2".
std::string place(const compare::Change& change);

}  // namespace heft::report
