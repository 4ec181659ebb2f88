/// @file
/// The heft command: finds the command asked for, runs it, turns what goes wrong into an exit code.
#include <algorithm>
#include <csignal>
#include <exception>
#include <map>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <malloc.h>
#include <fmt/format.h>
#include <unistd.h>

#include "command.hpp"
#include "command_line.hpp"
#include "console.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/file_plan.hpp"
#include "heft/host/parallel.hpp"
#include "heft/host/reproducible.hpp"
#include "heft/host/signals.hpp"
#include "heft/host/words.hpp"
#include "heft/page/origin.hpp"
#include "heft/urdf/urdf_export.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "options.hpp"
#include "program_text.hpp"

namespace heft::tools {
namespace {

const Command* find_command(const std::string& name) {
  const auto& all = commands();
  const auto found = std::find_if(all.begin(), all.end(), [&](const Command& c) { return name == c.name; });
  return found == all.end() ? nullptr : &*found;
}

std::string nearest_command(const std::string& name) {
  std::vector<std::string> names;
  for (const Command& command : commands()) names.emplace_back(command.name);
  return host::nearest_word(name, names);
}

int wrong_usage(const std::string& message, const std::string& command = {}) {
  print_to(stderr,
           fmt::format("heft: {}\nSee: heft {}--help\n", message, command.empty() ? "" : command + " "));
  return kWrongUsage;
}

/// Looks at every file that was given before any work: what cannot be written, or would overwrite what is read, is
/// refused now and not after minutes.
void look_at_files(const std::vector<GivenFile>& files) {
  host::FilePlan plan;
  for (const GivenFile& file : files) {
    switch (file.use) {
      case FileUse::kInput: plan.add_input(file.option, file.path); break;
      case FileUse::kMeasurements: plan.add_measurements(file.option, file.path); break;
      case FileUse::kOutput:
        plan.add_output(file.option, file.path);
        if (host::is_standard_output(file.path)) Console::leave_standard_output();
        break;
      case FileUse::kOutputFolder: plan.add_output_folder(file.option, file.path); break;
      case FileUse::kRobot: try { plan.add_input(file.option, urdf::resolve_robot(file.path));
        } catch (const InputError&) {
          // The command reports it when it reads the robot, after its outputs were looked at.
        }
        break;
    }
    if (file.option == "--write-urdf") {
      const std::string model = urdf::side_file_of(file.path);
      if (!model.empty()) plan.add_output("the model next to " + file.option, model);
    }
  }
  plan.check();
  plan.spool_pipes();
}

/// Standard streams that the caller closed: a file opened later would take their place and get what is printed.
void hold_standard_streams() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(descriptor, F_GETFD) != -1) continue;
    // Standard output stays unwritable, so that lost results are noticed; notes may go nowhere.
    ::open("/dev/null", descriptor == STDERR_FILENO ? O_WRONLY : O_RDONLY);
  }
}

/// Pieces of a log take and give back megabytes again and again. By default the system takes them back each time, and every
/// page costs a fault and a clearing when it comes again: a fifth of the time of identify. Threads that come and go would leave
/// it in a heap each; they share as many as there are processors.
void keep_freed_memory() {
  constexpr int kMegabyte = 1 << 20;
  ::mallopt(M_MMAP_THRESHOLD, 16 * kMegabyte);
  ::mallopt(M_TRIM_THRESHOLD, 256 * kMegabyte);
  ::mallopt(M_TOP_PAD, 4 * kMegabyte);
  ::mallopt(M_ARENA_MAX, static_cast<int>(std::max(1U, std::thread::hardware_concurrency())));
}

void take_signals() {
  host::remove_temporaries_on_signals();
  // A reader that leaves, or a limit on the size of files, must not end the command before its files are written; the
  // write fails instead.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

/// As other programs end in front of `head`.
void end_as_by_sigpipe() {
  std::signal(SIGPIPE, SIG_DFL);
  std::raise(SIGPIPE);
}

/// Exit code of a command whose text may not have arrived.
int with_output(int code) {
  const std::string lost = lost_output();
  if (lost.empty()) return code;
  if (reader_left()) end_as_by_sigpipe();
  print_to(stderr, fmt::format("heft: {}\n", lost));
  return code == kDone ? kBadInput : code;
}

/// `--man [COMMAND]` and `--completion SHELL`: the command line for other programs.
/// @return empty when neither was asked for
std::string text_asked_for(const CommandParser& parser, const std::vector<std::string>& words) {
  if (words.empty()) return {};
  if (words[0] == "--man" && words.size() <= 2)
    return man_page(parser.describe(), words.size() > 1 ? words[1] : "");
  if (words[0] == "--completion") {
    if (words.size() != 2) throw UsageError("--completion: expected one shell, bash or zsh");
    return completion(parser.describe(), words[1], urdf::robot_names());
  }
  return {};
}

int run(int argc, char** argv) {
  CommandParser parser(
      "heft", "heft: estimation and control of robot arms, from a log to firmware.",
      "heft " HEFT_VERSION "\nwith " HEFT_LIBRARIES,
      "heft COMMAND --help explains a command. heft --man [COMMAND] prints a man page, heft --completion bash|zsh what a\n"
      "shell needs to complete commands, options and values.\n"
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
  int threads = 0;
  for (const Command& command : commands()) {
    const CommandLine line = parser.add_command(command.name, command.summary);
    actions[command.name] = command.set_up(line);
    if (command.parallel) add_threads_option(line, threads);
  }

  std::string chosen;
  try {
    if (const std::string text = text_asked_for(parser, {argv + std::min(argc, 1), argv + argc});
        !text.empty()) {
      print_to(stdout, text);
      return kDone;
    }
    chosen = parser.parse(argc, argv);
  } catch (const UsageError& error) {
    if (argc < 2) {
      print_to(stderr, parser.help());
      return kWrongUsage;
    }
    const Command* command = find_command(argv[1]);
    return wrong_usage(error.what(), command ? command->name : "");
  }
  if (chosen.empty()) return kDone;  // --help, --version

  host::set_threads(static_cast<std::size_t>(threads));
  page::remember_command(argc, argv);
  try {
    look_at_files(parser.files());
    actions.at(chosen)();
    return kDone;
  } catch (const UsageError& error) {  // options that do not go together
    return wrong_usage(error.what(), chosen);
  } catch (const NotIdentifiableError& error) {
    print_to(stderr, fmt::format("heft {}: {}\n", chosen, error.what()));
    return kNotIdentifiable;
  } catch (const host::ReaderLeftError&) {
    end_as_by_sigpipe();
    return kBadInput;
  } catch (const InputError& error) {
    print_to(stderr, fmt::format("heft {}: {}\n", chosen, error.what()));
    return kBadInput;
  } catch (const std::bad_alloc&) {
    print_to(stderr,
             fmt::format("heft {}: memory ran out: the input asks for more than this computer (or its "
                         "limit, ulimit -v) gives; use shorter logs, or a lower rate or duration\n",
                         chosen));
    return kBadInput;
  }
}

}  // namespace
}  // namespace heft::tools

int main(int argc, char** argv) {
  heft::host::multiply_alike_everywhere();
  heft::tools::keep_freed_memory();
  heft::tools::hold_standard_streams();
  heft::tools::take_signals();
  try {
    return heft::tools::with_output(heft::tools::run(argc, argv));
  } catch (const std::exception& error) {
    heft::tools::print_to(
        stderr, fmt::format("heft: internal failure: {}\nThis is a defect of heft " HEFT_VERSION
                            ". Please report it with the command line and the files that lead to it.\n",
                            error.what()));
    return heft::tools::kInternalFailure;
  }
}
