#include "page_lines.hpp"

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
