/// @file
/// A model's torque, gravity torque or regressor along logs: as one sentence, as text, as JSON, as a page and as CSV.
#pragma once

#include <string>

#include "heft/page/page.hpp"
#include "heft/validate/inverse_dynamics.hpp"

namespace heft::report {

/// What was computed, for how many rows.
std::string brief(const validate::InverseDynamics& dynamics);
/// All of it for a terminal, as `heft dynamics` prints it: torque is compared with that of the log.
std::string full(const validate::InverseDynamics& dynamics);
/// One JSON object; its fields are described in tools/README.md.
std::string json(const validate::InverseDynamics& dynamics);
/// For each log the largest torque or the error against the log's, and plots.
page::Page page(const validate::InverseDynamics& dynamics);
/// All values, a line a row: with several logs first their number, from 1; then time, then the columns. Numbers in the
/// shortest form that reads back to the same.
std::string csv(const validate::InverseDynamics& dynamics);

}  // namespace heft::report
