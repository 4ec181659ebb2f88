/// @file
/// Fields of one line of a CSV file: what every reader of this room cuts and reads alike.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

namespace heft::data {

constexpr bool is_space(char c) { return c == ' ' || c == '\t'; }

inline std::string_view trim(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Shortens a field for a message, so that a binary file does not flood the terminal.
inline std::string shown(std::string_view field) {
  constexpr std::size_t kLongest = 40;
  std::string text;
  for (const char c : field.substr(0, kLongest)) text += (static_cast<unsigned char>(c) < 32) ? '?' : c;
  if (field.size() > kLongest) text += "...";
  return text;
}

/// The fields of a line, cut at commas, without surrounding spaces and quotes.
inline std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    std::string_view field = trim(line.substr(0, comma));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
      field = trim(field.substr(1, field.size() - 2));
    }
    fields.push_back(field);
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

enum class FieldProblem { kNone, kEmpty, kText, kNotFinite, kTooLarge };

/// Reads one number that starts at `at` and must end at a comma, a line end or `end`; moves `at` there.
inline FieldProblem read_number(const char*& at, const char* end, double& value) {
  while (at != end && is_space(*at)) ++at;
  const char* begin = at;
  if (begin == end || *begin == ',' || *begin == '\n' || *begin == '\r') return FieldProblem::kEmpty;
  if (*begin == '+' && begin + 1 != end && begin[1] != '-') ++begin;  // from_chars takes no plus sign
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error == std::errc::invalid_argument) return FieldProblem::kText;
  if (error == std::errc::result_out_of_range) {
    // Both too large and too small end here; too small is as good as zero.
    value = std::strtod(std::string(begin, stop).c_str(), nullptr);
    if (!(std::abs(value) <= 1.0)) return FieldProblem::kTooLarge;
  }
  at = stop;
  while (at != end && is_space(*at)) ++at;
  if (at != end && *at != ',' && *at != '\n' && !(*at == '\r' && (at + 1 == end || at[1] == '\n'))) {
    return FieldProblem::kText;
  }
  return std::isfinite(value) ? FieldProblem::kNone : FieldProblem::kNotFinite;
}

/// A line of nothing but white space.
inline bool is_blank(std::string_view line) {
  return std::all_of(line.begin(), line.end(), [](char c) { return is_space(c) || c == '\r'; });
}

}  // namespace heft::data
