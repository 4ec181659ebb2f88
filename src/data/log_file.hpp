/// @file
/// A log file read row by row, whatever its format; every check is made here, so that a log read whole and a log
/// read piece by piece are refused with the same words.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "log_reader.hpp"
#include "open_log.hpp"
#include "readers/text_reader.hpp"

namespace heft::data {

/// A channel that heft knows: its column prefix and its place in a Log.
struct Channel {
  std::string_view prefix;
  Eigen::MatrixXd Log::*matrix;
};

// The order in which a log is written (README.md in this folder).
inline constexpr std::array<Channel, 8> kChannels{{
    {"q", &Log::q},          // joint positions [rad, m]
    {"tau", &Log::tau},      // joint torques [N·m, N]
    {"i", &Log::current},    // motor currents [A]
    {"qd", &Log::qd},        // joint velocities [rad/s, m/s]
    {"qdd", &Log::qdd},      // joint accelerations [rad/s², m/s²]
    {"qref", &Log::qref},    // position references [rad, m]
    {"qdref", &Log::qdref},  // velocity references [rad/s, m/s]
    {"temp", &Log::temperature},
}};

/// A column of a file and what its numbers are to be multiplied by.
struct FileColumn {
  std::size_t column{0};
  double factor{1.0};
  bool operator==(const FileColumn&) const = default;
};

/// Neighbouring rows of a log, one at least.
struct FileRows {
  Eigen::VectorXd time;    ///< [s]
  Eigen::MatrixXd values;  ///< rows × columns asked for
};

/// Reads one log from front to back. Memory does not grow with the file.
class LogFile {
 public:
  /// Opens the file, finds its format by its content, and checks its columns against `needs`. Every column is wanted at
  /// first. Logs that arrive are text.
  /// @throws DataError
  LogFile(const std::string& path, const LogRequirements& needs, Reading reading = Reading::kWhole);

  int num_joints() const { return num_joints_; }
  /// Whether the log has all columns of a channel.
  bool has_channel(Eigen::MatrixXd Log::*matrix) const;
  /// Torque is to be made of `i` by the torque constants.
  bool torque_from_current() const { return use_current_; }
  /// That torque constants were given in vain, since the log has torque; "" otherwise.
  std::string unused_torque_constants() const;
  /// [N·m/A] of a joint, counted from 0.
  double torque_constant(int joint) const;

  std::size_t num_columns() const { return columns_.size(); }
  /// Its place in the row, num_columns() when there is none of that name.
  std::size_t find_column(std::string_view name) const;
  const std::string& column_name(std::size_t column) const { return columns_[column].name; }
  /// Time or part of a complete channel.
  bool is_known(std::size_t column) const { return columns_[column].known; }
  /// Another column, in which text was found so far.
  bool is_dropped(std::size_t column) const {
    return columns_[column].dropped ||
           (text_ != nullptr && column < file_columns_ && text_->is_dropped(column));
  }

  /// Skips every column but time and these from now on: their fields are not even looked at.
  void want_only(const std::vector<std::size_t>& columns);

  /// Reads the next row into values[0..num_columns()); what is not wanted stays as it was.
  /// @return false at the end of the file
  /// @throws DataError naming the line; of rows that arrive the next call then takes the row behind it
  bool next(double* values);
  /// All rows that are left, in sequence, any number at a time; text is read on all threads. The same checks as next().
  /// @throws DataError as next(), with the same words; not all rows before need have been used by then
  void for_each_rows(const std::vector<FileColumn>& columns, const std::function<void(const FileRows&)>& use);
  /// Number of the line read last; 0 where there are none.
  std::size_t line() const { return text_ != nullptr ? text_->line() : 0; }
  const LogReader& reader() const { return *reader_; }

  /// Gives back the file, at its end: what was found out about it remains, no row can be read.
  void close();

  long num_rows() const { return num_rows_; }
  /// Whether the rows read are as many as needed. @throws DataError
  void check_length() const;
  /// A note on columns beyond the known channels, "" when there are none. Columns of `used` are not
  /// mentioned.
  std::string note(const std::vector<std::size_t>& used = {}) const;
  /// How a file in other words or units than heft's was understood, and what its reader has to tell once it is at its
  /// end; "" when there is nothing.
  std::string how_read() const;
  /// Part of the file that was read, 0..1.
  double part_read() const { return reader_->part_read(); }

 private:
  struct Column {
    std::string name;
    bool known{false};  ///< time or a complete channel: a bad field is an error
    bool wanted{true};
    bool dropped{false};
  };
  template <typename... Args>
  [[noreturn]] void fail(const std::string& place, fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}: {}", place, fmt::format(format, std::forward<Args>(args)...)));
  }

  void check_time(double time);
  void take_text_times(const TextRows& read, FileRows& rows);
  void check_finite(const double* values);
  void find_channels();
  std::string or_map(std::string_view prefix) const;
  void check_required();
  void require_channel(std::string_view prefix, Eigen::MatrixXd Log::*matrix, std::string_view meaning,
                       std::string_view remedy) const;
  bool has(std::string_view name) const { return find_column(name) < columns_.size(); }
  std::string column_list() const;
  int highest(std::string_view prefix) const;
  int first_missing(std::string_view prefix, int count) const;

  std::string path_;
  LogRequirements needs_;
  Reading reading_;
  std::unique_ptr<LogReader> reader_;
  TextReader* text_{nullptr};    ///< the reader, when the log is text
  std::string header_;           ///< place of the names of columns
  std::size_t file_columns_{0};  ///< columns of the file; one more may hold the time that it lacks
  double rate_{0.0};             ///< [Hz] of a log without time; 0: it has one
  std::vector<Column> columns_;
  std::size_t time_column_{0};
  std::array<bool, kChannels.size()> complete_{};
  int num_joints_{0};
  bool use_current_{false};
  long num_rows_{0};
  double last_time_{0.0};
  std::size_t last_line_{0};  ///< of the last row taken; of the header where there is none
  double other_time_{0.0};    ///< of the last row refused for its time [s]
  int other_rows_{0};         ///< rows in a row refused for their time, though it increases among them
  std::vector<std::string> dropped_;  ///< by this class, in a binary log; all of them once the file is closed
  std::string how_;                   ///< how_read() of a closed file
};

/// All rows of a log, in memory. @param notes  as of read_log, without how the file was understood
Log rows_of(LogFile& file, const std::string& path, std::vector<std::string>* notes);

}  // namespace heft::data
