/// What stands above the rows of a text file: comments, names of columns, units.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>

#include "../csv_fields.hpp"
#include "text_reader.hpp"

namespace heft::data {
namespace {

/// A stamp above this has digits that a double does not hold, or soon will [ns].
constexpr double kWholeNanoseconds = 1e15;

bool is_comment(std::string_view line) {
  const std::string_view text = trim(line);
  return !text.empty() && (text.front() == '#' || text.front() == '%');
}

std::string_view behind_marks(std::string_view line) {
  line = trim(line);
  while (!line.empty() && (line.front() == '#' || line.front() == '%')) line.remove_prefix(1);
  return line;
}

/// "%time" of rostopic is a name; all else behind these marks is without them.
std::string header_behind_marks(std::string_view line) {
  return std::string(trim(line).starts_with("%time") ? trim(line) : trim(behind_marks(line)));
}

std::string_view without_return(std::string_view line) {
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

/// Whether a row of numbers fits the names of a line.
bool is_row_below(std::string_view names, std::string_view row) {
  const char separator = separator_of(names);
  std::vector<std::string_view> fields, numbers;
  split_fields(names, separator, true, fields);
  split_fields(row, separator, false, numbers);
  return !numbers.empty() && numbers.size() == fields.size() && is_number(numbers.front()) &&
         !is_number(fields.front());
}

}  // namespace

/// The line of names. Lines that begin with # or % above it are comments; where a row of as many numbers follows them at
/// once, the last of them holds the names.
std::string TextReader::header_line() {
  fill(line_ + 1);
  // Spreadsheets put a byte-order mark in front.
  if (filled_ >= 3 && std::memcmp(buffer_.data(), "\xEF\xBB\xBF", 3) == 0) at_ = 3;
  std::string comment;
  for (;;) {
    if (!next_line()) {
      if (!comment.empty()) return header_behind_marks(comment);
      throw DataError(fmt::format(
          "{}: the log is empty; expected a header line (time,q1,...) and rows of numbers", path_));
    }
    if (is_blank(line_text())) continue;
    if (is_comment(line_text())) {
      comment = without_return(line_text());
      continue;
    }
    if (!comment.empty()) {
      const std::string names = header_behind_marks(comment);
      if (is_row_below(names, line_text())) {
        return_line();
        return names;
      }
    }
    return std::string(without_return(line_text()));
  }
}

std::vector<std::string> TextReader::names_of(std::string_view line) {
  dialect_.separator = separator_of(line);
  std::vector<std::string_view> names;
  split_fields(line, dialect_.separator, true, names);
  if (!names.empty() && is_number(names.front())) {
    fail(line_,
         "column 1: found the number '{}' where a name is due; expected a header line such as time,q1,q2; "
         "put the column names into the first line",
         shown(names.front()));
  }
  std::vector<std::string> headers;
  std::map<std::string_view, std::size_t> seen;
  for (std::size_t c = 0; c < names.size(); ++c) {
    headers.push_back(names[c].empty() ? fmt::format("unnamed_{}", c + 1) : std::string(names[c]));
    if (names[c].empty()) continue;
    const auto [before, is_new] = seen.emplace(names[c], c + 1);
    if (!is_new) {
      fail(line_,
           "column '{}' is there twice (fields {} and {}); expected every name once; rename or drop one",
           headers.back(), before->second, c + 1);
    }
  }
  return headers;
}

void TextReader::read_header() {
  const std::string line = header_line();
  headers_ = names_of(line);
  state_.resize(headers_.size());
  const std::size_t header = line_;
  if (reading_ == Reading::kWhole) look_below_header();
  const std::size_t below = line_;
  line_ = header;
  understand();
  if (reading_ == Reading::kWhole) guess_time_unit();
  line_ = below;
  prepare_rows();
}

/// A line of units below the names. @return whether there is one
bool TextReader::look_below_header() {
  unit_line_looked_for_ = true;
  if (!next_line()) return false;
  const std::optional<std::vector<std::string>> units = units_in(line_text(), dialect_.separator);
  if (!units || units->size() != headers_.size()) {
    return_line();
    return false;
  }
  for (std::size_t c = 0; c < headers_.size(); ++c) {
    if (!(*units)[c].empty()) headers_[c] += fmt::format(" [{}]", (*units)[c]);
  }
  return true;
}

void TextReader::understand() {
  columns_ = in_heft_words(headers_, as_, place());
  time_column_ = nanoseconds_column_ = columns_.size();
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].name == "time") time_column_ = c;
    if (columns_[c].name == kNanosecondsPart) nanoseconds_column_ = c;
  }
  whole_time_ = nanoseconds_column_ < columns_.size() ||
                (time_column_ < columns_.size() && columns_[time_column_].factor == 1e-9);
}

/// Stamps since 1970 tell their unit by their size, where a header of another program does not.
void TextReader::guess_time_unit() {
  if (time_column_ == columns_.size() || !next_line()) return;
  split_fields(line_text(), dialect_.separator, false, fields_);
  LogColumn& time = columns_[time_column_];
  double first = 0.0;
  if (fields_.size() > time_column_) {
    const std::string_view field = fields_[time_column_];
    std::from_chars(field.data(), field.data() + field.size(), first);
  }
  return_line();
  if (time.factor == 1.0 && time.origin != "time" && nanoseconds_column_ == columns_.size()) {
    if (first > 1e17) {
      time.factor = 1e-9;
    } else if (first > 1e14) {
      time.factor = 1e-6;
    } else if (first > 1e11) {
      time.factor = 1e-3;
    }
  }
  whole_time_ =
      nanoseconds_column_ < columns_.size() || (time.factor == 1e-9 && std::abs(first) > kWholeNanoseconds);
}

void TextReader::prepare_rows() {
  split_rows_ = dialect_.separator != ',' || whole_time_;
  conversions_.clear();
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const LogColumn& column = columns_[c];
    if ((column.factor == 1.0 && column.shift == 0.0) || (whole_time_ && c == time_column_)) continue;
    // A division by 1000 is exact to the last bit, a multiplication by 0.001 is not.
    const double inverse = std::round(1.0 / column.factor);
    const bool divides = inverse > 1.0 && 1.0 / inverse == column.factor;
    conversions_.push_back({c, divides ? 1.0 : column.factor, divides ? inverse : 1.0, column.shift});
  }
}

std::string TextReader::format() const {
  return dialect_.words() + (source_.is_gzip() ? ", packed by gzip" : "");
}

}  // namespace heft::data
