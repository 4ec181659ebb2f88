/// @file
/// The heft command: finds the command asked for, runs it, turns what goes wrong into an exit code.
#include <algorithm>
#include <exception>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.hpp"
#include "command_line.hpp"
#include "heft/host/error.hpp"

namespace heft::tools {
namespace {

/// Number of letters to insert, delete or change to make `b` of `a`.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

const Command* find_command(const std::string& name) {
  const auto& all = commands();
  const auto found = std::find_if(all.begin(), all.end(), [&](const Command& c) { return name == c.name; });
  return found == all.end() ? nullptr : &*found;
}

std::string nearest_command(const std::string& name) {
  const auto& all = commands();
  const auto best = std::min_element(all.begin(), all.end(), [&](const Command& a, const Command& b) {
    return edit_distance(name, a.name) < edit_distance(name, b.name);
  });
  return edit_distance(name, best->name) <= std::max<std::size_t>(2, name.size() / 3) ? best->name : "";
}

int wrong_usage(const std::string& message, const std::string& command = {}) {
  fmt::print(stderr, "heft: {}\nSee: heft {}--help\n", message, command.empty() ? "" : command + " ");
  return kWrongUsage;
}

int run(int argc, char** argv) {
  CommandParser parser(
      "heft", "heft: estimation and control of robot arms, from a log to firmware.", "heft " HEFT_VERSION,
      "heft COMMAND --help explains a command.\n"
      "Results go to standard output, progress and notes to standard error. SI units throughout.\n"
      "Exit codes: 0 done; 1 internal failure; 2 wrong usage; 3 bad input; 4 the data cannot answer the "
      "question.");

  // A first word that is no command gets a better answer than the parser's.
  if (argc >= 2 && argv[1][0] != '-') {
    const std::string name = argv[1];
    if (find_command(name) == nullptr) {
      const std::string nearest = nearest_command(name);
      return wrong_usage(fmt::format("there is no command '{}'{}", name,
                                     nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
    }
  }

  std::map<std::string, Action> actions;
  for (const Command& command : commands()) {
    actions[command.name] = command.set_up(parser.add_command(command.name, command.summary));
  }

  std::string chosen;
  try {
    chosen = parser.parse(argc, argv);
  } catch (const UsageError& error) {
    if (argc < 2) {
      fmt::print(stderr, "{}", parser.help());
      return kWrongUsage;
    }
    const Command* command = find_command(argv[1]);
    return wrong_usage(error.what(), command ? command->name : "");
  }
  if (chosen.empty()) return kDone;  // --help, --version

  try {
    actions.at(chosen)();
    return kDone;
  } catch (const UsageError& error) {  // options that do not go together
    return wrong_usage(error.what(), chosen);
  } catch (const NotIdentifiableError& error) {
    fmt::print(stderr, "heft {}: {}\n", chosen, error.what());
    return kNotIdentifiable;
  } catch (const InputError& error) {
    fmt::print(stderr, "heft {}: {}\n", chosen, error.what());
    return kBadInput;
  }
}

}  // namespace
}  // namespace heft::tools

int main(int argc, char** argv) {
  try {
    return heft::tools::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr,
               "heft: internal failure: {}\nThis is a defect of heft " HEFT_VERSION
               ". Please report it with the command line and the files that lead to it.\n",
               error.what());
    return heft::tools::kInternalFailure;
  }
}
