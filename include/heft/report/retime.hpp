/// @file
/// The fastest motion along a path in words, as JSON and as a page: what heft retime prints and writes.
#pragma once

#include <string>

#include "heft/page/page.hpp"
#include "heft/retime/retime.hpp"

namespace heft::report {

/// One sentence: how long the motion takes, and took.
std::string brief(const retime::Retiming& found);
/// What the command prints; ends with a line break.
std::string full(const retime::Retiming& found);
/// Fields of the result in tools/README.md.
std::string json(const retime::Retiming& found);
/// Speed over the path below the fastest that can still be stopped, which limit decides when, torque and velocity of each joint.
page::Page page(const retime::Retiming& found);

}  // namespace heft::report
