/// @file
/// The heft command run as a user runs it, without a terminal. Needs the definition HEFT_COMMAND.
#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>
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

/// The command with `input` on its standard input, through a pipe.
/// @param arguments  as a shell takes them
/// @param from       folder to run in
inline Outcome piped_heft(const std::string& arguments, const std::string& input, const std::string& from) {
  const TemporaryFolder streams;
  host::write_file_atomically(streams.path("in"), input);
  const std::string command = "cd " + shell_quote(from) + " && cat " + shell_quote(streams.path("in")) +
                              " | " + shell_quote(HEFT_COMMAND) + " " + arguments + " >" +
                              shell_quote(streams.path("out")) + " 2>" + shell_quote(streams.path("err"));
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, host::read_file(streams.path("out"), "output"),
          host::read_file(streams.path("err"), "output")};
}

/// The lines of a text, without their line feeds.
inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// A recorder whose rows the command reads while they are written.
class Recorder {
 public:
  /// @param arguments  of heft, as a shell takes them
  /// @param from       folder to run in; output is in live.out and live.err there
  Recorder(const std::string& arguments, const std::string& from) : from_(from) {
    host::write_file_atomically(from + "/live.out", "");  // there before the command is
    const std::string command = "cd " + shell_quote(from) + " && " + shell_quote(HEFT_COMMAND) + " " +
                                arguments + " >live.out 2>live.err";
    pipe_ = ::popen(command.c_str(), "w");
  }
  ~Recorder() {
    if (pipe_ != nullptr) ::pclose(pipe_);
  }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  bool running() const { return pipe_ != nullptr; }
  void write(const std::string& row) { std::fprintf(pipe_, "%s\n", row.c_str()); }
  /// What the command has said so far.
  std::string said() { return host::read_file(from_ + "/live.out", "output"); }
  /// Hands over what was written and waits until the command says something, 10 s at most.
  std::string wait_for_words() {
    std::fflush(pipe_);
    for (int wait = 0; wait < 200 && said().empty(); ++wait)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return said();
  }
  void hand_over() { std::fflush(pipe_); }
  /// Ends the stream. @return the exit code
  int stop() {
    const int status = ::pclose(pipe_);
    pipe_ = nullptr;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  std::string from_;
  std::FILE* pipe_{nullptr};
};

}  // namespace heft::test
