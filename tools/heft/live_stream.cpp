#include "live_stream.hpp"

#include <cstdio>
#include <optional>

#include <fmt/format.h>

#include "console.hpp"

namespace heft::tools {

void add_stream_argument(CommandLine line, std::string& stream) {
  line.add_option(
          "stream", stream,
          "'-': a log on standard input, row by row as it arrives; prints a line when something changes")
      .type_name("-");
}

void refuse_with_stream(CommandLine line, const std::string& stream, const ResultOptions& result,
                        std::initializer_list<const char*> others) {
  if (stream != "-")
    throw UsageError(
        fmt::format("found '{0}'; expected a log with --log {0}, or '-' for rows on standard input", stream));
  for (const char* name : others) {
    if (line.count(name) > 0)
      throw UsageError(
          fmt::format("{} does not go with '-': a stream is read row by row as it arrives", name));
  }
  if (!result.report.empty()) throw UsageError("--report does not go with '-': a page needs a whole log");
  if (!result.json.empty() && result.json != "-")
    throw UsageError("--json of a stream is a line for each event on standard output; give --json -");
}

namespace {

/// Torque, of this robot.
data::LogRequirements live_needs(const LogOptions& options, const model::Robot& robot) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.torque = true;
  const data::LogFiles files = files_of(options, robot);
  needs.torque_constant = files.torque_constant;
  needs.as = files.as;
  return needs;
}

}  // namespace

LiveRows::LiveRows(const std::string& stream, const LogOptions& options, const model::Robot& robot,
                   TorqueAt at)
    : options_(options),
      log_(stream, live_needs(options, robot), note),
      check_(robot, stream, torque_options(at)) {}

bool LiveRows::next(data::LiveRow& row) {
  const bool more = log_.next(row);
  const std::optional<plausibility::TorqueCheck> found = more ? check_.push(row) : check_.end();
  if (found) static_cast<void>(judgement_of(*found, options_));
  return more;
}

void LiveOutput::print(const std::string& text, const std::string& json) {
  print_to(json_ ? stderr : stdout, text + "\n");
  if (json_) print_to(stdout, json + "\n");
  is_read_ = lost_output().empty();  // flushes
}

}  // namespace heft::tools
