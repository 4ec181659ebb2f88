/// @file
/// How well a model predicts: as one sentence, as text, as JSON and as a page.
#pragma once

#include <string>

#include "heft/page/page.hpp"
#include "heft/validate/validate.hpp"

namespace heft::report {

/// The error of the worst joint in percent of its largest torque.
std::string brief(const validate::Validation& judged);
/// All of it for a terminal, as `heft validate` prints it.
std::string full(const validate::Validation& judged);
/// One JSON object; its fields are described in src/report/README.md.
std::string json(const validate::Validation& judged);
/// Verdict, acceptance criterion, errors of each log with plots where Options::traces asked for them.
page::Page page(const validate::Validation& judged);

}  // namespace heft::report
