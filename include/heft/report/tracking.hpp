/// @file
/// A tracking comparison in words, as JSON, as a page.
#pragma once

#include <string>

#include "heft/page/page.hpp"
#include "heft/track/track.hpp"

namespace heft::report {

/// One sentence: the errors with the estimated load, with nominal values, of PD.
std::string brief(const track::Tracking& tracking);
/// What `heft track` prints: tables of errors, the load, the verdict.
std::string full(const track::Tracking& tracking);
/// Fields as tools/README.md names them.
std::string json(const track::Tracking& tracking);
page::Page page(const track::Tracking& tracking);

}  // namespace heft::report
