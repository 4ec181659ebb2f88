/// @file
/// What a command of heft is, and the table of all of them.
#pragma once

#include <functional>
#include <vector>

namespace CLI {
class App;
}

namespace heft::tools {

/// Exit codes of the command.
enum ExitCode : int { kDone = 0, kInternalFailure = 1, kWrongUsage = 2, kBadInput = 3, kNotIdentifiable = 4 };

/// What a command does once its options are read. Throws for everything but success.
using Action = std::function<void()>;

/// One command.
struct Command {
  const char* name;
  const char* summary;  ///< one line for `heft --help`
  /// Adds the options to `app` and returns the work; null: the command is not in this version.
  Action (*set_up)(CLI::App& app);
};

/// All commands in the order of the help text.
const std::vector<Command>& commands();

Action set_up_dynamics(CLI::App& app);
Action set_up_simulate(CLI::App& app);
Action set_up_excite(CLI::App& app);
Action set_up_validate(CLI::App& app);
Action set_up_identify(CLI::App& app);
Action set_up_diagnose(CLI::App& app);
Action set_up_payload(CLI::App& app);
Action set_up_export(CLI::App& app);
Action set_up_track(CLI::App& app);
Action set_up_reproduce(CLI::App& app);
Action set_up_demo(CLI::App& app);

}  // namespace heft::tools
