/// @file
/// Two models of one robot compared: as one sentence a change, as text, as JSON and as a page.
#pragma once

#include <string>

#include "heft/compare/compare.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// What changed, one sentence each, the largest first; or that nothing did.
std::string brief(const compare::Comparison& comparison);
/// What `heft compare` prints: the changes, torque by its parts, what could not be compared.
std::string full(const compare::Comparison& comparison);
/// Fields as tools/README.md names them.
std::string json(const compare::Comparison& comparison);
/// Verdict, friction curves of both models with their intervals, tables.
page::Page page(const compare::Comparison& comparison);

}  // namespace heft::report
