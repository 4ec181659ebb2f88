#include "live_stream.hpp"

#include <cstdio>

#include <fmt/format.h>

#include "console.hpp"

namespace heft::tools {

void add_stream_argument(CommandLine line, std::string& stream) {
  line.add_option(
          "stream", stream,
          "'-': a log on standard input, row by row as it arrives; prints a line when something changes")
      .type_name("-")
      .one_of({"-"});
}

void refuse_with_stream(CommandLine line, const ResultOptions& result,
                        std::initializer_list<const char*> others) {
  for (const char* name : others) {
    if (line.count(name) > 0)
      throw UsageError(
          fmt::format("{} does not go with '-': a stream is read row by row as it arrives", name));
  }
  if (!result.report.empty()) throw UsageError("--report does not go with '-': a page needs a whole log");
  if (!result.json.empty() && result.json != "-")
    throw UsageError("--json of a stream is a line for each event on standard output; give --json -");
}

data::LogRequirements live_needs(const LogOptions& options, const model::Robot& robot) {
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  needs.torque = true;
  needs.torque_constant = files_of(options, robot).torque_constant;
  return needs;
}

void LiveOutput::print(const std::string& text, const std::string& json) {
  print_to(json_ ? stderr : stdout, text + "\n");
  if (json_) print_to(stdout, json + "\n");
  is_read_ = lost_output().empty();  // flushes
}

}  // namespace heft::tools
