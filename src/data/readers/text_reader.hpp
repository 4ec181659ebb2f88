/// @file
/// Logs as text: heft's CSV and its kin.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "../log_reader.hpp"
#include "heft/host/error.hpp"
#include "text_dialect.hpp"
#include "text_source.hpp"

namespace heft::data {

/// How a log is read.
enum class Reading {
  kWhole,  ///< a file that has an end
  kArriving  ///< rows as they arrive: never waits for more than the next line, goes on behind a row that it refuses
};

/// Rows of neighbouring lines of a text.
struct TextRows {
  std::size_t first_line{0};  ///< number of the line of the first row; every row has a line of its own
  std::vector<std::size_t> lines{};  ///< of each row, where some are not the next; otherwise empty
  Eigen::MatrixXd values;     ///< rows × columns asked for

  std::size_t line_of(Eigen::Index row) const {
    return lines.empty() ? first_line + static_cast<std::size_t>(row) : lines[static_cast<std::size_t>(row)];
  }
};

/// Reads rows of text. Memory: a buffer of a few lines' length, however long the file.
class TextReader : public LogReader {
 public:
  /// Reads the header.
  /// @param path  for messages
  /// @throws DataError
  TextReader(host::InputFile file, const std::string& path, const ReadAs& as, Reading reading);

  std::string format() const override;
  const std::vector<LogColumn>& columns() const override { return columns_; }
  void want_only(const std::vector<std::size_t>& columns) override;
  /// @throws DataError naming the line; of rows that arrive the next call then takes the row behind it
  bool next(double* values) override;
  std::string place() const override { return fmt::format("{}:{}", path_, line_); }
  double part_read() const override { return source_.part_read(); }

  /// Reads all rows that are left, on all threads, and calls `use` with them in their order, one call at a time. Only the
  /// columns that are wanted are looked at. What cannot be read is refused as by next(): the first place in the file, with
  /// the same words, whatever the number of threads; the rows before it have been used by then.
  /// @param columns  numbers of those asked for
  void for_each_rows(const std::vector<std::size_t>& columns, const std::function<void(const TextRows&)>& use);

  /// Number of the line read last.
  std::size_t line() const { return line_; }
  /// Messages are about this line from now on.
  void stand_at(std::size_t line) { line_ = line; }
  /// A bad field of this column is an error; other columns are dropped at the first text.
  void require(std::size_t column) { state_[column].required = true; }
  bool is_dropped(std::size_t column) const { return state_[column].dropped; }
  /// "mode ('auto' in line 2)" of every column dropped so far.
  const std::vector<std::string>& dropped() const { return dropped_; }

 private:
  struct ColumnState {
    bool required{false};
    bool wanted{true};
    bool dropped{false};
  };
  /// A column whose numbers are not in SI units.
  struct Conversion {
    std::size_t column;
    double factor, divisor, shift;  ///< SI = number · factor / divisor + shift
  };
  template <typename... Args>
  [[noreturn]] void fail(std::size_t line, fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}:{}: {}", path_, line, fmt::format(format, std::forward<Args>(args)...)));
  }

  /// Lines of the file, and what was read of them.
  struct Lines {
    std::vector<char> text;
    std::size_t first_line{0}, count{0};
    bool terminated{true};  ///< the last one has a line feed
  };
  struct ReadLines {
    Lines lines;
    Eigen::MatrixXd values;  ///< rows × columns asked for, of the lines from the front that are plain rows of numbers
    Eigen::Index rows{0};
    std::size_t rest{0};     ///< place in the text behind them
    int begins_with{-1};     ///< decimals of the last number of the first row
    int decimals{-1};        ///< what `decimals_` would be behind these rows alone
  };
  /// What the reading of lines on other threads goes by; it does not change meanwhile.
  struct PlainRows {
    std::vector<int> targets;  ///< of each column of the file: its place among those asked for; -1: passed over
    std::vector<Conversion> conversions;  ///< of the columns asked for
    Eigen::Index columns{0};
  };
  PlainRows plain_rows(const std::vector<std::size_t>& columns) const;
  bool take_lines(std::size_t& taken, Lines& lines);
  static ReadLines read_plain(Lines lines, const PlainRows& rows);
  void read_rest(ReadLines& read, const std::vector<std::size_t>& columns,
                 const std::function<void(const TextRows&)>& use);
  bool is_row_line();
  void refuse_blank_line_before_row();
  void take_row(double* values);

  bool fill(std::size_t line);
  bool next_line();
  void return_line();
  std::string_view line_text() const {
    return {line_begin_, static_cast<std::size_t>(line_end_ - line_begin_)};
  }

  std::string header_line();
  void read_header();
  std::vector<std::string> names_of(std::string_view line);
  bool look_below_header();
  void understand();
  void guess_time_unit();
  void prepare_rows();

  bool next_row_line();
  void take_fields(double* values);
  void take_plain_fields(double* values);
  int read_field(std::string_view field, double& value);
  void take_whole_time(double* values);
  std::int64_t whole_number(std::size_t column) const;
  void refuse_field(std::size_t index, std::string_view field, int problem);
  [[noreturn]] void fail_ragged() const;
  std::size_t count_fields() const;
  void look_at_end_of_line();

  std::string path_;
  ReadAs as_;
  Reading reading_;
  TextSource source_;
  TextDialect dialect_;
  std::vector<char> buffer_;
  std::size_t at_{0};      ///< of the first byte not yet used
  std::size_t filled_{0};  ///< end of what is in the buffer
  bool at_end_{false};     ///< the file has no more
  const char* line_begin_{nullptr};
  const char* line_end_{nullptr};  ///< its line feed, or the end of the file
  std::size_t line_{0};            ///< number of that line
  bool terminated_{true};          ///< that line has a line feed
  int decimals_{-1};               ///< of the last number of every row so far; -2: not the same in all
  long num_rows_{0};
  std::size_t blank_line_{0};      ///< first of a run of blank lines, harmless at the end of the file only; 0: none

  std::vector<std::string> headers_;
  std::vector<LogColumn> columns_;
  std::vector<ColumnState> state_;
  std::vector<Conversion> conversions_;
  std::vector<std::string> dropped_;
  bool unit_line_looked_for_{false};
  bool split_rows_{false};  ///< fields are cut first and read then: everything but plain CSV
  std::vector<std::string_view> fields_;
  std::size_t decimal_line_{0};  ///< first line in which the mark of decimals was seen; 0: none yet

  /// Stamps of so many digits that a double does not hold them: counted from the first, in whole numbers.
  bool whole_time_{false}, has_first_time_{false};
  std::size_t time_column_{0}, nanoseconds_column_{0};  ///< number of columns: none
  std::int64_t first_time_{0}, first_nanoseconds_{0};
};

}  // namespace heft::data
