/// @file
/// A motion that separates rival explanations: in words, as JSON, as a page.
#pragma once

#include <string>

#include "heft/excite/separate.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Which rivals the motion decides between, in one sentence.
std::string brief(const excite::SeparatingMotion& motion);
/// What `heft excite --separate` prints: the pairs with their distances, what the motion reaches of every limit.
std::string full(const excite::SeparatingMotion& motion);
/// Fields as tools/README.md names them.
std::string json(const excite::SeparatingMotion& motion);
page::Page page(const excite::SeparatingMotion& motion);

}  // namespace heft::report
