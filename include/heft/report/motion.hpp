/// @file
/// Motions for identification in words, as JSON and as a page: what heft excite prints and writes.
#pragma once

#include <string>

#include "heft/excite/excite.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// One sentence: how many parameters at which condition number.
std::string brief(const excite::ExcitingMotion& motion);
/// What the command prints; ends with a line break.
std::string full(const excite::ExcitingMotion& motion);
/// Fields of the result in tools/README.md.
std::string json(const excite::ExcitingMotion& motion);
page::Page page(const excite::ExcitingMotion& motion);

/// One sentence: how many strokes.
std::string brief(const excite::FrictionMotion& motion);
std::string full(const excite::FrictionMotion& motion);
std::string json(const excite::FrictionMotion& motion);
page::Page page(const excite::FrictionMotion& motion);

}  // namespace heft::report
