/// @file
/// A log file read row by row; every check of the format is made here, so that a log read whole and a log
/// read piece by piece are refused with the same words.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

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

/// How a log is read.
enum class Reading {
  kWhole,  ///< a file that has an end
  kArriving  ///< rows as they arrive: never waits for more than the next line, goes on behind a row that it refuses
};

/// Reads one log from front to back. Memory: a buffer of a few lines' length, however long the file.
class LogFile {
 public:
  /// Opens the file, reads the header and checks it against `needs`. Every column is wanted at first.
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
  bool is_dropped(std::size_t column) const { return columns_[column].dropped; }

  /// Skips every column but time and these from now on: their fields are not even looked at.
  void want_only(const std::vector<std::size_t>& columns);

  /// Reads the next row into values[0..num_columns()); what is not wanted stays as it was.
  /// @return false at the end of the file
  /// @throws DataError naming the line; of rows that arrive the next call then takes the row behind it
  bool next(double* values);
  /// Number of the line read last.
  std::size_t line() const { return line_; }

  long num_rows() const { return num_rows_; }
  /// Whether the rows read are as many as needed. @throws DataError
  void check_length() const;
  /// A note on columns beyond the known channels, "" when there are none. Columns of `used` are not
  /// mentioned.
  std::string note(const std::vector<std::size_t>& used = {}) const;
  /// Part of the file that was read, 0..1.
  double part_read() const;

 private:
  struct Column {
    std::string name;
    bool known{false};  ///< time or a complete channel: a bad field is an error
    bool wanted{true};
    bool dropped{false};
  };
  template <typename... Args>
  [[noreturn]] void fail(std::size_t line, fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}:{}: {}", path_, line, fmt::format(format, std::forward<Args>(args)...)));
  }

  void open();
  bool fill();
  void check_time(double time);
  bool next_line();
  void read_header();
  void find_channels();
  void check_required();
  void require_channel(std::string_view prefix, Eigen::MatrixXd Log::*matrix, std::string_view meaning,
                       std::string_view remedy) const;
  bool has(std::string_view name) const { return find_column(name) < columns_.size(); }
  std::string column_list() const;
  int highest(std::string_view prefix) const;
  int first_missing(std::string_view prefix, int count) const;
  void refuse_field(std::size_t index, const char* begin, int problem);
  void look_at_end_of_line();
  [[noreturn]] void fail_ragged() const;

  std::string path_;
  LogRequirements needs_;
  Reading reading_;
  host::InputFile file_;
  double file_size_{0.0};
  double bytes_read_{0.0};
  std::vector<char> buffer_;
  std::size_t at_{0};      ///< of the first byte not yet used
  std::size_t filled_{0};  ///< end of what is in the buffer
  bool at_end_{false};     ///< the file has no more
  const char* line_begin_{nullptr};
  const char* line_end_{nullptr};  ///< its line feed, or the end of the file
  std::size_t line_{0};            ///< number of that line
  bool terminated_{true};          ///< that line has a line feed
  int decimals_{-1};               ///< of the last number of every row so far; -2: not the same in all
  std::vector<Column> columns_;
  std::size_t time_column_{0};
  std::array<bool, kChannels.size()> complete_{};
  int num_joints_{0};
  bool use_current_{false};
  long num_rows_{0};
  double last_time_{0.0};
  std::size_t last_line_{0};  ///< of the last row taken
  double other_time_{0.0};    ///< of the last row refused for its time [s]
  int other_rows_{0};         ///< rows in a row refused for their time, though it increases among them
  std::vector<std::string> dropped_;
};

}  // namespace heft::data
