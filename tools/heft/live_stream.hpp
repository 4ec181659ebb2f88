/// @file
/// What commands share that read a log from standard input as it is written: `heft monitor -`, `heft payload -`.
#pragma once

#include <initializer_list>
#include <string>

#include "command_line.hpp"
#include "heft/data/live_log.hpp"
#include "heft/model/robot.hpp"
#include "heft/plausibility/plausibility.hpp"
#include "options.hpp"

namespace heft::tools {

/// The argument `-`.
void add_stream_argument(CommandLine line, std::string& stream);
/// @param stream  what was given as the argument
/// @param others  options that mean nothing for a stream
/// @throws UsageError for an argument that is not '-', when one of them was given, or --report, or --json with anything but `-`
void refuse_with_stream(CommandLine line, const std::string& stream, const ResultOptions& result,
                        std::initializer_list<const char*> others);

/// Rows of a stream with their torque, which is compared with the robot as that of a log is, see judge_torque.
class LiveRows {
 public:
  /// Waits for the header and checks it; what is refused and what is doubtful goes to standard error.
  /// @param at  where the torque was measured
  /// @throws DataError as data::LiveLog
  LiveRows(const std::string& stream, const LogOptions& options, const model::Robot& robot, TorqueAt at);
  /// Waits for the next row.
  /// @return false at the end
  /// @throws DataError as data::LiveLog::next; when the rows so far contradict the robot and --accept-torque was not given
  bool next(data::LiveRow& row);
  long refused() const { return log_.refused(); }

 private:
  LogOptions options_;
  data::LiveLog log_;
  plausibility::LiveCheck check_;
};

/// Lines that are out as soon as they are printed: text, or one of JSON each with `--json -`, and the text on standard
/// error.
class LiveOutput {
 public:
  explicit LiveOutput(const ResultOptions& options) : json_(!options.json.empty()) {}
  void print(const std::string& text, const std::string& json);
  /// False once a line could not be written: whoever read them has left.
  bool is_read() const { return is_read_; }

 private:
  bool json_;
  bool is_read_{true};
};

}  // namespace heft::tools
