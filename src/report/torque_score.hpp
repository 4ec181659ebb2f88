/// @file
/// The parts that answers share as they are inside this room: JSON that goes into an answer's own, and logs at the end of a page.
#pragma once

#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "heft/data/log.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/report/score.hpp"
#include "page_lines.hpp"

namespace heft::report {

/// A log as the end of a page states it.
LogLine log_line(const data::StreamSummary& summary);
LogLine log_line(const data::Log& log, double low_pass = 0.0);

/// The errors alone, one row a joint.
page::Table score_table(const validate::Score& score);

/// Fields of the result that score_table() shows.
nlohmann::ordered_json score_json(const validate::Score& score);
/// All figures of a score.
nlohmann::ordered_json validation_json(const validate::Score& score);
nlohmann::ordered_json criteria_json(const std::vector<validate::Criterion>& criteria);
/// Fields of the result that describe a fit: base_parameters, condition_number, physically_consistent, missing.
nlohmann::ordered_json fit_json(const model::FitRecord& fit);

}  // namespace heft::report
