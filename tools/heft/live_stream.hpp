/// @file
/// What commands share that read a log from standard input as it is written: `heft monitor -`, `heft payload -`.
#pragma once

#include <initializer_list>
#include <string>

#include "command_line.hpp"
#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"
#include "options.hpp"

namespace heft::tools {

/// The argument `-`.
void add_stream_argument(CommandLine line, std::string& stream);
/// @param others  options that mean nothing for a stream
/// @throws UsageError when one of them was given, or --report, or --json with anything but `-`
void refuse_with_stream(CommandLine line, const ResultOptions& result,
                        std::initializer_list<const char*> others);

/// What is needed of the rows: torque, of this robot.
data::LogRequirements live_needs(const LogOptions& options, const model::Robot& robot);

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
