/// @file
/// The command line as texts that other programs read: man pages, and completion of commands, options and values in a shell.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "command_line.hpp"

namespace heft::tools {

/// An option as it is described.
struct OptionText {
  std::vector<std::string> names;  ///< "-o", "--output"; without dashes: an argument by its place
  std::string placeholder;         ///< of its value, "FILE"; empty: a flag
  std::string meaning;
  std::vector<std::string> words;  ///< what the value may be; empty: anything
  std::optional<FileUse> file;     ///< what is done with the file that the value names
  bool required{false};

  bool is_argument() const { return names.front().front() != '-'; }
};

struct CommandText {
  std::string name, summary, footer;
  std::vector<OptionText> options;
};

/// A program with its commands.
struct ProgramText {
  std::string name, description, version, footer;
  std::vector<CommandText> commands;
};

/// Man page (section 1, troff) of the program, or of one of its commands.
/// @param command  its name; empty: the program
/// @throws UsageError for a command that does not exist
std::string man_page(const ProgramText& program, const std::string& command = {});

/// Script that a shell reads to complete commands, options, words, robots and file names.
/// @param shell   "bash" or "zsh"
/// @param robots  names that options for robots take beside files
/// @throws UsageError for another shell
std::string completion(const ProgramText& program, const std::string& shell,
                       const std::vector<std::string>& robots);

}  // namespace heft::tools
