/// @file
/// What all pages and results have in common: the verdict with its reasons, file names without their folders, and the
/// lines at the end that say how the page came to be.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "heft/host/verdict.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Keeps the command line for the pages.
void remember_command(int argc, const char* const* argv);

/// An empty page whose end names the command, the date, and heft's version and commit.
page::Page new_page(const std::string& title, const std::string& subtitle = {});

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

/// "Verdict: doubtful" and a line a reason; ends with a line break.
std::string verdict_text(const host::Judgement& judgement);
/// Fields "verdict" and "reasons".
void put_verdict(nlohmann::ordered_json& json, const host::Judgement& judgement);

/// A JSON result as text. Names of files are bytes; what is not UTF-8 in them must not cost the result.
std::string text_of(const nlohmann::ordered_json& json);

/// A word as a shell takes it literally.
std::string shell_word(const std::string& word);

}  // namespace heft::report
