/// @file
/// What all pages and results have in common: the verdict with its reasons, file names without their folders, and what
/// the end of a page says of each log.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "heft/host/verdict.hpp"
#include "heft/page/origin.hpp"
#include "heft/page/page.hpp"
#include "heft/report/verdict.hpp"

namespace heft::report {

/// What was done to a log.
struct LogLine {
  std::string path;
  double sample_rate{0.0};  ///< [Hz]; 0: not known
  double duration{0.0};     ///< [s]
  double low_pass{0.0};     ///< [Hz]; 0: none
};
void add_log_line(page::Page& page, const LogLine& log);

/// "run-a.csv" of "/data/run-a.csv"; a stretch keeps its times.
std::string file_name_of(const std::string& path);
/// "run-a.csv, run-b.csv".
std::string file_names_of(const std::vector<std::string>& paths);

/// The file of a log's residuals without its columns: label, name and notes.
/// @param samples  that each row is the mean of
page::DataFile residual_file(const std::string& log, long samples);

/// Fields "verdict" and "reasons".
void put_verdict(nlohmann::ordered_json& json, const host::Judgement& judgement);

/// A JSON result as text. Names of files are bytes; what is not UTF-8 in them must not cost the result.
std::string text_of(const nlohmann::ordered_json& json);

}  // namespace heft::report
