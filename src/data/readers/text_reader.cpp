#include "text_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>

#include "../csv_fields.hpp"

namespace heft::data {
namespace {

/// Bytes taken from the file at once.
constexpr std::size_t kBlock = std::size_t{1} << 18;

/// Longest line: far more than 10 000 columns take. What is longer is no log, and would fill the memory.
constexpr std::size_t kLongestLine = std::size_t{1} << 24;

/// The text of the field that begins at `begin`, for messages.
std::string_view field_at(const char* begin, const char* end) {
  const char* stop = begin;
  while (stop != end && *stop != ',' && *stop != '\n') ++stop;
  std::string_view field(begin, static_cast<std::size_t>(stop - begin));
  if (!field.empty() && field.back() == '\r') field.remove_suffix(1);
  return trim(field);
}

}  // namespace

TextReader::TextReader(host::InputFile file, const std::string& path, const ReadAs& as, Reading reading)
    : path_(path), as_(as), reading_(reading), source_(std::move(file), path, reading == Reading::kArriving) {
  buffer_.resize(kBlock);
  read_header();
}

/// Takes more of the file behind what is left in the buffer. @return false when the file has no more
/// @param line  number of the line that the buffer holds a part of, or none of
bool TextReader::fill(std::size_t line) {
  if (at_end_) return false;
  std::memmove(buffer_.data(), buffer_.data() + at_, filled_ - at_);
  filled_ -= at_;
  at_ = 0;
  if (filled_ == buffer_.size()) {  // a line longer than the buffer
    if (filled_ >= kLongestLine) {
      fail(line,
           "found a line of more than {} million bytes; expected rows of numbers (CSV); this is no log",
           kLongestLine >> 20);
    }
    buffer_.resize(2 * buffer_.size());
  }
  char* const to = buffer_.data() + filled_;
  const std::size_t count = source_.read(to, buffer_.size() - filled_);
  if (count == 0) {
    at_end_ = true;
    return false;
  }
  if (reading_ == Reading::kWhole && std::memchr(to, '\0', count) != nullptr) {
    fail(line,
         "found a zero byte in this line or soon behind it; expected text (CSV); this is a binary file, "
         "text of another encoding than UTF-8, or a log that was not written to its end; convert it");
  }
  filled_ += count;
  return true;
}

/// Moves to the next line, which is in the buffer as a whole. @return false at the end of the file
bool TextReader::next_line() {
  std::size_t searched = 0;
  for (;;) {
    const char* const begin = buffer_.data() + at_;
    const std::size_t count = filled_ - at_;
    const void* stop = std::memchr(begin + searched, '\n', count - searched);
    if (stop == nullptr) {
      searched = count;
      if (fill(line_ + 1)) continue;
      if (filled_ == at_) return false;
    }
    line_begin_ = buffer_.data() + at_;
    line_end_ = (stop != nullptr) ? static_cast<const char*>(stop) : buffer_.data() + filled_;
    at_ = static_cast<std::size_t>(line_end_ - buffer_.data()) + (stop != nullptr ? 1 : 0);
    ++line_;
    terminated_ = stop != nullptr;
    return true;
  }
}

/// next_line() gives this line again.
void TextReader::return_line() {
  at_ = static_cast<std::size_t>(line_begin_ - buffer_.data());
  --line_;
}

/// A log that was cut inside its last number still looks like a row. Where all rows have as many decimals, fewer at the
/// end of the file give it away.
void TextReader::look_at_end_of_line() {
  constexpr long kEnoughRows = 10;
  if (decimals_ == -2) return;
  const int count = decimals_at_end(line_text(), dialect_.separator, dialect_.decimal_comma ? ',' : '.');
  if (decimals_ == -1) decimals_ = count;
  if (count == decimals_) return;
  if (!terminated_ && num_rows_ >= kEnoughRows && decimals_ > 0 && count < decimals_) {
    const char* field = line_end_;
    while (field != line_begin_ && field[-1] != dialect_.separator) --field;
    fail(line_,
         "column '{}': found '{}' and the end of the file; expected {} decimals as in every row before, and "
         "a line "
         "feed: the log was cut inside this number; remove the line",
         headers_.back(), shown(trim({field, static_cast<std::size_t>(line_end_ - field)})), decimals_);
  }
  decimals_ = -2;
}

void TextReader::want_only(const std::vector<std::size_t>& columns) {
  for (ColumnState& column : state_) column.wanted = false;
  for (const std::size_t c : columns) state_[c].wanted = true;
  if (time_column_ < columns_.size()) state_[time_column_].wanted = true;
}

/// Whether the present line is a row. Blank lines are none, which is harmless at the end of the file only.
bool TextReader::is_row_line() {
  if (is_blank(line_text())) {
    if (blank_line_ == 0) blank_line_ = line_;
    return false;
  }
  refuse_blank_line_before_row();
  return true;
}

void TextReader::refuse_blank_line_before_row() {
  if (blank_line_ != 0 && reading_ == Reading::kWhole) {
    fail(blank_line_,
         "column 'time': found a blank line between rows; expected {} fields in every row; "
         "remove the blank line",
         columns_.size());
  }
  blank_line_ = 0;
}

/// Moves to the next row. @return false at the end of the file
bool TextReader::next_row_line() {
  do {
    if (!next_line()) return false;
  } while (!is_row_line());
  if (!unit_line_looked_for_) {  // of rows that arrive, the first
    return_line();
    if (look_below_header()) {
      --line_;  // what is wrong with the units is wrong with the header: no row is refused
      understand();
      ++line_;
      prepare_rows();
    }
    return next_row_line();
  }
  return true;
}

bool TextReader::next(double* values) {
  if (!next_row_line()) return false;
  take_row(values);
  return true;
}

/// The present line.
void TextReader::take_row(double* values) {
  if (split_rows_) {
    take_fields(values);
  } else {
    take_plain_fields(values);
  }
  for (const Conversion& conversion : conversions_) {
    double& value = values[conversion.column];
    if (state_[conversion.column].wanted)
      value = value * conversion.factor / conversion.divisor + conversion.shift;
  }
  look_at_end_of_line();
  ++num_rows_;
}

/// A row of plain CSV: every field is read where it stands.
void TextReader::take_plain_fields(double* values) {
  const char* at = line_begin_;
  const char* const end = line_end_;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (c > 0) {
      if (at == end || *at != ',') fail_ragged();
      ++at;
    }
    const ColumnState& column = state_[c];
    const char* const begin = at;
    if (column.wanted && !column.dropped) {
      const FieldProblem problem = read_number(at, end, values[c]);
      if (problem == FieldProblem::kNone) [[likely]]
        continue;
      if (problem == FieldProblem::kText && *field_at(begin, end).data() == '"') {
        split_rows_ = true;  // quoted fields
        return take_fields(values);
      }
      refuse_field(c, field_at(begin, end), static_cast<int>(problem));
    }
    const void* comma = std::memchr(begin, ',', static_cast<std::size_t>(end - begin));
    at = (comma != nullptr) ? static_cast<const char*>(comma) : end;
  }
  if (at != end && *at == ',') fail_ragged();
}

/// A row whose fields are cut first.
void TextReader::take_fields(double* values) {
  split_fields(line_text(), dialect_.separator, false, fields_);
  if (fields_.size() != columns_.size()) fail_ragged();
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const ColumnState& column = state_[c];
    if (!column.wanted || column.dropped || (whole_time_ && c == time_column_)) continue;
    const int problem = read_field(fields_[c], values[c]);
    if (problem != static_cast<int>(FieldProblem::kNone)) refuse_field(c, fields_[c], problem);
  }
  if (whole_time_) take_whole_time(values);
}

int TextReader::read_field(std::string_view field, double& value) {
  constexpr std::size_t kLongest = 64;
  std::array<char, kLongest> copy{};
  const std::size_t mark = field.find(',');
  const bool comma = mark != std::string_view::npos;
  if ((comma || field.find('.') != std::string_view::npos) && dialect_.separator != ',') {
    if (decimal_line_ == 0) {
      decimal_line_ = line_;
      dialect_.decimal_comma = comma;
    } else if (dialect_.decimal_comma != comma) {
      fail(
          line_,
          "found '{}' with a decimal {} though line {} has decimal {}; expected one mark in all rows; write the log anew",
          shown(field), comma ? "comma" : "point", decimal_line_, comma ? "points" : "commas");
    }
  }
  if (comma && field.size() < kLongest) {
    std::copy(field.begin(), field.end(), copy.begin());
    copy[mark] = '.';
    field = {copy.data(), field.size()};
  }
  const char* at = field.data();
  const FieldProblem problem = read_number(at, field.data() + field.size(), value);
  if (problem != FieldProblem::kNone) return static_cast<int>(problem);
  return static_cast<int>(at == field.data() + field.size() ? FieldProblem::kNone : FieldProblem::kText);
}

std::int64_t TextReader::whole_number(std::size_t column) const {
  const std::string_view field = fields_[column];
  std::int64_t number = 0;
  const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), number);
  if (error != std::errc() || stop != field.data() + field.size()) {
    fail(line_, "column '{}': found '{}'; expected a whole number (a time stamp); correct or remove the row",
         headers_[column], shown(field));
  }
  return number;
}

/// Time since the first row, from stamps whose digits a double does not hold.
void TextReader::take_whole_time(double* values) {
  const bool parts = nanoseconds_column_ < columns_.size();
  const std::int64_t time = whole_number(time_column_),
                     nanoseconds = parts ? whole_number(nanoseconds_column_) : 0;
  if (!has_first_time_) {
    has_first_time_ = true;
    first_time_ = time;
    first_nanoseconds_ = nanoseconds;
  }
  // Differences of whole numbers of any size that stamps have: in unsigned numbers none overflows.
  const auto since =
      static_cast<std::int64_t>(static_cast<std::uint64_t>(time) - static_cast<std::uint64_t>(first_time_));
  if (!parts) {
    values[time_column_] = static_cast<double>(since) / 1e9;
    return;
  }
  const auto rest = static_cast<std::int64_t>(static_cast<std::uint64_t>(nanoseconds) -
                                              static_cast<std::uint64_t>(first_nanoseconds_));
  values[time_column_] = (static_cast<double>(since) * 1e9 + static_cast<double>(rest)) / 1e9;
}

/// Throws for a field of a required column; drops the column otherwise.
void TextReader::refuse_field(std::size_t index, std::string_view field, int problem) {
  ColumnState& column = state_[index];
  const std::string& name = columns_[index].name;
  if (!column.required) {
    // A number is due only in known channels: the others are dropped at the first text.
    dropped_.push_back(fmt::format("{} ('{}' in line {})", name, shown(field), line_));
    column.dropped = true;
    return;
  }
  switch (static_cast<FieldProblem>(problem)) {
    case FieldProblem::kEmpty:
      // A short row may end in the middle of the numbers: say that rather than "empty field".
      if (count_fields() != columns_.size()) fail_ragged();
      fail(line_, "column '{}': found an empty field; expected a number; fill it or remove the row", name);
    case FieldProblem::kNotFinite:
      fail(line_, "column '{}': found '{}'; expected a finite number; remove the row or repair the value",
           name, shown(field));
    case FieldProblem::kTooLarge:
      fail(line_, "column '{}': found '{}', which is too large; expected a finite number in SI units", name,
           shown(field));
    case FieldProblem::kText:
    case FieldProblem::kNone: break;
  }
  if (count_fields() != columns_.size() && separator_of(line_text()) != dialect_.separator) {
    fail(
        line_,
        "found fields separated by {} though those of the header are by {}; expected one in all lines; write the log anew",
        separator_words(separator_of(line_text())), separator_words(dialect_.separator));
  }
  fail(line_,
       "column '{}': found '{}'; expected a number (decimal point, no unit); correct or remove the row", name,
       shown(field));
}

std::size_t TextReader::count_fields() const {
  if (dialect_.separator == ',' && !split_rows_)
    return static_cast<std::size_t>(std::count(line_begin_, line_end_, ',')) + 1;
  std::vector<std::string_view> fields;
  split_fields(line_text(), dialect_.separator, false, fields);
  return fields.size();
}

void TextReader::fail_ragged() const {
  const std::size_t found = count_fields();
  if (found < columns_.size()) {
    fail(line_,
         "column '{}' is missing: found {} fields; expected {} as in the header; complete or remove the row",
         columns_[found].name, found, columns_.size());
  }
  fail(line_,
       "column '{}' is followed by more fields: found {}; expected {} as in the header; "
       "remove the surplus (a decimal comma also looks like this)",
       columns_.back().name, found, columns_.size());
}

}  // namespace heft::data
