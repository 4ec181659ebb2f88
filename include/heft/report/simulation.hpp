/// @file
/// A simulation: as one sentence, as text, as JSON and as a page.
#pragma once

#include <string>

#include "heft/page/page.hpp"
#include "heft/sim/simulation.hpp"

namespace heft::report {

/// How long it was and how often the load changed.
std::string brief(const sim::Simulation& simulation);
/// All of it for a terminal, as `heft simulate` prints it.
std::string full(const sim::Simulation& simulation);
/// One JSON object; its fields are described in tools/README.md.
std::string json(const sim::Simulation& simulation);
/// Errors and largest torques, plots of position and torque.
page::Page page(const sim::Simulation& simulation);

}  // namespace heft::report
