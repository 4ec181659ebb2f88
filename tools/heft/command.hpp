/// @file
/// What a command of heft is, and the table of all of them.
#pragma once

#include <functional>
#include <vector>

#include "command_line.hpp"

namespace heft::tools {

/// Exit codes of the command.
enum ExitCode : int { kDone = 0, kInternalFailure = 1, kWrongUsage = 2, kBadInput = 3, kNotIdentifiable = 4 };

/// What a command does once its options are read. Throws for everything but success.
using Action = std::function<void()>;

/// One command.
struct Command {
  const char* name;
  const char* summary;  ///< one line for `heft --help`
  /// Adds the options to `line` and returns the work.
  Action (*set_up)(CommandLine line);
  bool parallel{true};  ///< takes --threads: it reads logs, or works on all processors
};

/// All commands in the order of the help text.
const std::vector<Command>& commands();

Action set_up_dynamics(CommandLine line);
Action set_up_log(CommandLine line);
Action set_up_simulate(CommandLine line);
Action set_up_excite(CommandLine line);
Action set_up_validate(CommandLine line);
Action set_up_identify(CommandLine line);
Action set_up_diagnose(CommandLine line);
Action set_up_compare(CommandLine line);
Action set_up_payload(CommandLine line);
Action set_up_torque_constants(CommandLine line);
Action set_up_monitor(CommandLine line);
Action set_up_export(CommandLine line);
Action set_up_track(CommandLine line);
Action set_up_retime(CommandLine line);
Action set_up_stiffness(CommandLine line);
Action set_up_reproduce(CommandLine line);
Action set_up_demo(CommandLine line);

}  // namespace heft::tools
