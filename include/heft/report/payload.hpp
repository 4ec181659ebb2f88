/// @file
/// A load in words, as JSON, as a page.
#pragma once

#include <string>
#include <vector>

#include "heft/page/page.hpp"
#include "heft/payload/payload.hpp"

namespace heft::report {

/// One sentence: the mass with its interval, or why there is none.
std::string brief(const payload::Payload& load);
/// What `heft payload` prints about one log.
std::string full(const payload::Payload& load);
/// Fields as tools/README.md names them.
std::string json(const payload::Payload& load);

/// What a row of a live stream brought about: one line, as `heft payload -` prints it.
std::string brief(const payload::LiveEvent& event);
/// What the stream held: one line.
std::string brief(const payload::LiveSummary& summary);
/// The same as one line of JSON each; fields in tools/README.md.
std::string json(const payload::LiveEvent& event);
std::string json(const payload::LiveSummary& summary);

/// One sentence: where the model of the arm without load comes from.
std::string brief(const payload::UnloadedArm& arm);
/// The same with the model's residual, where it was fitted.
std::string full(const payload::UnloadedArm& arm);

/// One sentence a load.
std::string brief(const payload::Weighing& found);
/// What `heft payload` prints: the arm, then each load.
std::string full(const payload::Weighing& found);
/// An object for one load, a list for several.
std::string json(const payload::Weighing& found);
page::Page page(const payload::Weighing& found);

}  // namespace heft::report
