/// @file
/// Fields of one line of a CSV file: what every reader of this room cuts and reads alike.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
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

/// The same for most numbers at several times the speed, with the same bits: few enough digits that number and power of ten
/// are exact as double, so that one division rounds once (Clinger, How to read floating point numbers accurately, 1990).
/// Nothing else is looked at here.
/// @return false, with `at` as it was, for anything but such a number followed by a comma or the end
inline bool read_plain_number(const char*& at, const char* end, double& value) {
  constexpr std::size_t kMostDecimals = 22;
  static constexpr std::array<double, kMostDecimals + 1> kPowers{1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                                 1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                                 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  constexpr std::uint64_t kExact = std::uint64_t{1} << 53U;
  constexpr std::ptrdiff_t kMostDigits = 18;  // more do not fit into 64 bits
  const char* c = at;
  const bool negative = c != end && *c == '-';
  if (negative) ++c;
  const char* const first = c;
  std::uint64_t digits = 0;
  const auto is_digit = [&] { return c != end && static_cast<unsigned char>(*c - '0') < 10; };
  while (is_digit()) digits = 10 * digits + static_cast<std::uint64_t>(*c++ - '0');
  const std::ptrdiff_t before = c - first;
  std::ptrdiff_t decimals = 0;
  if (c != end && *c == '.') {
    const char* const point = c++;
    while (is_digit()) digits = 10 * digits + static_cast<std::uint64_t>(*c++ - '0');
    decimals = c - point - 1;
  }
  const std::ptrdiff_t count = before + decimals;
  if (count == 0 || count > kMostDigits || digits > kExact) return false;
  if (c != end && *c != ',') return false;
  const double size = static_cast<double>(digits) / kPowers[static_cast<std::size_t>(decimals)];
  value = negative ? -size : size;
  at = c;
  return true;
}

/// Decimals of the last number of a line; -1 where it has none.
inline int decimals_at_end(std::string_view line, char separator, char mark) {
  constexpr int kMostDigits = 32;
  int digits = 0;
  int count = -1;
  for (std::size_t at = line.size(); at > 0 && digits < kMostDigits; ++digits) {
    const char c = line[--at];
    if (c == '\r' || (c == ' ' && separator != ' ')) --digits;
    if (c == mark) count = digits;
    if (c == mark || c == separator) break;
  }
  return count;
}

/// A line of nothing but white space.
inline bool is_blank(std::string_view line) {
  return std::all_of(line.begin(), line.end(), [](char c) { return is_space(c) || c == '\r'; });
}

}  // namespace heft::data
