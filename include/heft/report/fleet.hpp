/// @file
/// Arms of one type compared: as one sentence an arm, as text, as JSON and as a page.
#pragma once

#include <string>

#include "heft/compare/fleet.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Which arms differ from the rest and in what, one sentence a parameter; or that none does.
std::string brief(const compare::FleetComparison& fleet);
/// With the table of what the arms have in common.
std::string full(const compare::FleetComparison& fleet);
/// One JSON object; its fields are described in src/report/README.md.
std::string json(const compare::FleetComparison& fleet);
page::Page page(const compare::FleetComparison& fleet);

}  // namespace heft::report
