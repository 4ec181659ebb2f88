#include "page_lines.hpp"

#include <cctype>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace heft::report {

void add_log_line(page::Page& page, const LogLine& log) {
  std::string line = fmt::format("{}: ", log.path);
  if (log.sample_rate > 0.0) line += fmt::format("{:.4g} samples a second, ", log.sample_rate);
  line += fmt::format("{:.4g} s", log.duration);
  line += log.low_pass > 0.0 ? fmt::format(", low-pass {:.3g} Hz.", log.low_pass) : std::string(".");
  page.footer(line);
}

std::string file_name_of(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  return slash == std::string::npos || slash + 1 == path.size() ? path : path.substr(slash + 1);
}

std::string file_names_of(const std::vector<std::string>& paths) {
  std::string names;
  for (const std::string& path : paths) names += (names.empty() ? "" : ", ") + file_name_of(path);
  return names;
}

page::DataFile residual_file(const std::string& log, long samples) {
  const std::string log_name = file_name_of(log);
  std::string stem = log_name.substr(0, log_name.find(".csv"));
  for (char& c : stem) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_') c = '-';
  }
  return {
      fmt::format("Save the residuals of {} (CSV)", log_name),
      fmt::format("residuals-{}.csv", stem),
      {fmt::format("{}: measured minus predicted torque [N·m; prismatic joints: N] over time [s]", log_name),
       samples > 1 ? fmt::format("each row is the mean of {} samples, beginning at its time", samples)
                   : std::string("every sample"),
       "values to four millionths of what their column spans"}};
}

std::string verdict_text(const host::Judgement& judgement) {
  std::string text = fmt::format("Verdict: {}\n", host::to_string(judgement.verdict));
  for (const std::string& reason : judgement.reasons) text += fmt::format("  - {}\n", reason);
  return text;
}

void put_verdict(nlohmann::ordered_json& json, const host::Judgement& judgement) {
  json["verdict"] = host::to_string(judgement.verdict);
  json["reasons"] = judgement.reasons;
}

std::string verdict_json(const host::Judgement& judgement) {
  nlohmann::ordered_json json;
  put_verdict(json, judgement);
  return text_of(json);
}

std::string text_of(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace heft::report
