/// @file
/// The heft command run as a user runs it, without a terminal. Needs the definition HEFT_COMMAND.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <sys/wait.h>

#include "heft/host/file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::test {

struct Outcome {
  int exit_code{-1};
  std::string out;
  std::string err;
};

/// A word as the shell takes it literally.
inline std::string shell_quote(const std::string& word) {
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// The command under a name that a shell takes for one word without quotes, wherever the build folder is.
/// @param folder  where a link to it is made
inline std::string command_without_blanks(const TemporaryFolder& folder) {
  const std::string link = folder.path("heft");
  std::filesystem::create_symlink(HEFT_COMMAND, link);
  return link;
}

/// @param from  folder to run in; empty: the present one
inline Outcome run_heft(const std::vector<std::string>& arguments, const std::string& from = "") {
  const TemporaryFolder streams;
  std::string command = from.empty() ? "" : "cd " + shell_quote(from) + " && ";
  command += shell_quote(HEFT_COMMAND);
  for (const std::string& argument : arguments) command += " " + shell_quote(argument);
  command +=
      " >" + shell_quote(streams.path("out")) + " 2>" + shell_quote(streams.path("err")) + " </dev/null";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, host::read_file(streams.path("out"), "output"),
          host::read_file(streams.path("err"), "output")};
}

}  // namespace heft::test
