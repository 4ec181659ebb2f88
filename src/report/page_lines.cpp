#include "page_lines.hpp"

#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace heft::report {
namespace {

std::string& command_line() {
  static std::string line;
  return line;
}

}  // namespace

std::string shell_word(const std::string& word) {
  constexpr const char* kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=+,:@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

void remember_command(int argc, const char* const* argv) {
  // How the program was found says nothing about the result.
  command_line() = "heft";
  for (int k = 1; k < argc; ++k) command_line() += " " + shell_word(argv[k]);
}

page::Page new_page(const std::string& title, const std::string& subtitle) {
  page::Page page(title, subtitle);
  if (!command_line().empty()) page.footer(command_line());
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  page.footer(fmt::format("{:%Y-%m-%d %H:%M} UTC, heft {}, commit {}.", utc, HEFT_VERSION, HEFT_COMMIT));
  return page;
}

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

std::string text_of(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace heft::report
