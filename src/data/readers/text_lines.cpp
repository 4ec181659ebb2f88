// Rows of a text on all threads: one takes lines from the file, all read numbers, one at a time hands rows over.
#include <algorithm>
#include <cstring>
#include <utility>

#include "../csv_fields.hpp"
#include "heft/host/parallel.hpp"
#include "text_reader.hpp"

namespace heft::data {

using Eigen::Index;

/// Lines read at once stay in the cache of a processor; more of them on their way do not grow the memory.
static constexpr std::size_t kMostThreads = 16;

/// The lines that are whole in the buffer, at least one.
/// @param taken  lines of the file so far
/// @return false at the end of the file
bool TextReader::take_lines(std::size_t& taken, Lines& lines) {
  const char* stop = nullptr;
  for (;;) {
    const char* const begin = buffer_.data() + at_;
    const std::size_t count = filled_ - at_;
    stop = static_cast<const char*>(::memrchr(begin, '\n', count));
    if (stop != nullptr) break;
    if (fill(taken + 1)) continue;
    if (count == 0) return false;
    stop = buffer_.data() + filled_ - 1;  // the last line has no line feed
    break;
  }
  const char* const begin = buffer_.data() + at_;
  lines.text.assign(begin, stop + 1);
  lines.first_line = taken + 1;
  lines.terminated = *stop == '\n';
  lines.count = static_cast<std::size_t>(std::count(begin, stop + 1, '\n')) + (lines.terminated ? 0 : 1);
  taken += lines.count;
  at_ += lines.text.size();
  return true;
}

TextReader::PlainRows TextReader::plain_rows(const std::vector<std::size_t>& columns) const {
  PlainRows rows;
  // What is no plain CSV, and logs in which a column may still turn out to hold text, is left to read_rest().
  rows.columns = split_rows_ ? -1 : static_cast<Index>(columns.size());
  rows.targets.assign(columns_.size(), -1);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const auto place = std::find(columns.begin(), columns.end(), c);
    if (place != columns.end()) {
      rows.targets[c] = static_cast<int>(place - columns.begin());
    } else if (state_[c].wanted && !state_[c].dropped) {
      rows.targets[c] = -2;  // a number is due
    }
  }
  for (const Conversion& conversion : conversions_) {
    const int target = rows.targets[conversion.column];
    if (target < 0) continue;
    rows.conversions.push_back(conversion);
    rows.conversions.back().column = static_cast<std::size_t>(target);
  }
  return rows;
}

/// Rows from the front on, up to the first line that is anything but a row of plain numbers with a line feed.
TextReader::ReadLines TextReader::read_plain(Lines lines, const PlainRows& rows) {
  ReadLines read;
  read.lines = std::move(lines);
  if (rows.columns < 0) return read;
  const std::vector<char>& text = read.lines.text;
  const auto most = static_cast<Index>(read.lines.count - (read.lines.terminated ? 0 : 1));
  read.values.resize(most, rows.columns);
  const char* line = text.data();
  for (; read.rows < most; ++read.rows) {
    const char* const stop = static_cast<const char*>(
        std::memchr(line, '\n', static_cast<std::size_t>(text.data() + text.size() - line)));
    const char* end = stop;
    if (end != line && end[-1] == '\r') --end;
    const char* at = line;
    double passed_over = 0.0;
    bool sound = true;
    for (std::size_t c = 0; c < rows.targets.size() && sound; ++c) {
      if (c > 0) {
        sound = at != end && *at == ',';
        if (!sound) break;
        ++at;
      }
      const int target = rows.targets[c];
      if (target != -1) {
        double& value = target < 0 ? passed_over : read.values(read.rows, target);
        sound = read_plain_number(at, end, value) || read_number(at, end, value) == FieldProblem::kNone;
      } else {
        while (at != end && *at != ',') ++at;
      }
    }
    if (!sound || at != end) break;
    if (read.decimals != -2) {
      const int count = decimals_at_end({line, static_cast<std::size_t>(stop - line)}, ',', '.');
      if (read.rows == 0) read.begins_with = count;
      if (read.decimals == -1) read.decimals = count;
      if (read.decimals != count) read.decimals = -2;
    }
    line = stop + 1;
  }
  read.rest = static_cast<std::size_t>(line - text.data());
  for (const Conversion& conversion : rows.conversions) {
    auto values = read.values.col(static_cast<Index>(conversion.column)).head(read.rows).array();
    values = values * conversion.factor / conversion.divisor + conversion.shift;
  }
  return read;
}

/// The lines behind the plain rows, one by one. Rows before one that is refused are handed over.
void TextReader::read_rest(ReadLines& read, const std::vector<std::size_t>& columns,
                           const std::function<void(const TextRows&)>& use) {
  const std::vector<char>& text = read.lines.text;
  TextRows rows;
  rows.values.resize(static_cast<Index>(read.lines.count) - read.rows, static_cast<Index>(columns.size()));
  std::vector<double> row(columns_.size(), 0.0);
  const auto hand_over = [&] {
    rows.values.conservativeResize(static_cast<Index>(rows.lines.size()), Eigen::NoChange);
    if (!rows.lines.empty()) use(rows);
  };
  try {
    for (std::size_t at = read.rest; at < text.size();) {
      line_begin_ = text.data() + at;
      const void* const stop = std::memchr(line_begin_, '\n', text.size() - at);
      terminated_ = stop != nullptr;
      line_end_ = terminated_ ? static_cast<const char*>(stop) : text.data() + text.size();
      at = static_cast<std::size_t>(line_end_ - text.data()) + (terminated_ ? 1 : 0);
      ++line_;
      if (!is_row_line()) continue;
      take_row(row.data());
      const auto number = static_cast<Index>(rows.lines.size());
      for (std::size_t c = 0; c < columns.size(); ++c) rows.values(number, static_cast<Index>(c)) = row[columns[c]];
      rows.lines.push_back(line_);
    }
  } catch (const DataError&) {
    const std::size_t line = line_;
    hand_over();  // what is wrong in an earlier row comes first
    line_ = line;
    throw;
  }
  hand_over();
}

void TextReader::for_each_rows(const std::vector<std::size_t>& columns,
                               const std::function<void(const TextRows&)>& use) {
  std::size_t taken = line_;
  const auto accept = [&](ReadLines& read) {
    line_ = read.lines.first_line - 1;
    if (read.rows > 0) {
      refuse_blank_line_before_row();
      if (decimals_ == -1) {
        decimals_ = read.decimals;
      } else if (read.begins_with != decimals_ || read.decimals != decimals_) {
        decimals_ = -2;
      }
      num_rows_ += static_cast<long>(read.rows);
      line_ = read.lines.first_line + static_cast<std::size_t>(read.rows) - 1;
      TextRows rows;
      rows.first_line = read.lines.first_line;
      rows.values = std::move(read.values);
      if (rows.values.rows() != read.rows) rows.values.conservativeResize(read.rows, Eigen::NoChange);
      const std::size_t line = line_;
      use(rows);
      line_ = line;
    }
    read_rest(read, columns, use);
  };
  // The first lines show which columns hold text; no thread but this one reads them.
  Lines first;
  if (!take_lines(taken, first)) return;
  ReadLines whole;
  whole.lines = std::move(first);
  accept(whole);
  const PlainRows plain = plain_rows(columns);
  host::for_each_in_order<Lines, ReadLines>(
      kMostThreads, [&](Lines& lines) { return take_lines(taken, lines); },
      [&](Lines& lines) { return read_plain(std::move(lines), plain); }, accept);
}

}  // namespace heft::data
