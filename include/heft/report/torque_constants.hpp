/// @file
/// Torque constants in words, as JSON, as a page.
#pragma once

#include <string>

#include "heft/drive/torque_constants.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// One sentence: which joints are known, and how well.
std::string brief(const drive::TorqueConstants& constants);
/// What `heft torque-constants` prints: a row a joint, the logs beside one another, the verdict.
std::string full(const drive::TorqueConstants& constants);
/// Fields as tools/README.md names them.
std::string json(const drive::TorqueConstants& constants);
page::Page page(const drive::TorqueConstants& constants);

}  // namespace heft::report
