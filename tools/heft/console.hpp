/// @file
/// What people see: results on standard output, notes and progress on standard error.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>

#include <fmt/format.h>

namespace heft::tools {

/// Writes text to a stream; lines are broken to the width of a terminal. Never throws: a failure
/// is remembered for lost_output(), so that a command goes on to write its files.
void print_to(std::FILE* stream, const std::string& text) noexcept;

/// Flushes both streams.
/// @return what went wrong with standard output or standard error since the start; empty: nothing
std::string lost_output() noexcept;

/// Whether standard output was closed by its reader (`| head`), which is no mistake of anyone.
bool reader_left() noexcept;

/// The stream for results. It is standard error when standard output carries a file (`-o -`, `--json -`).
class Console {
 public:
  /// @param outputs  the paths that the command writes to
  Console(std::initializer_list<std::string> outputs);
  /// From now on every console is on standard error, whatever the paths it is given.
  static void leave_standard_output() noexcept;
  template <typename... Args>
  void print(fmt::format_string<Args...> format, Args&&... args) const {
    print_to(stream_, fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  std::FILE* stream_{stdout};
};

/// A line on standard error: `heft: warning: ...`.
void warn(const std::string& text);
/// A line on standard error: `heft: note: ...`.
void note(const std::string& text);

/// Progress of a long job, on standard error: on a terminal one line that counts up, once it takes over a second;
/// elsewhere (a file, a pipe) a line every ten seconds. It never counts down: a stage that restarts waits until it is
/// past what was shown.
class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// @param done  0..1
  /// @param what  printed behind the label; may be empty
  void update(double done, const std::string& what = {});

 private:
  std::string label_;
  bool terminal_;
  bool shown_{false};
  int last_percent_{-1};
  std::string last_what_;
  std::chrono::steady_clock::time_point start_, last_line_;
};

/// Writes a JSON result; whole or not at all. `-` is standard output; nothing happens for an empty path.
void write_json(const std::string& path, const std::string& json);

}  // namespace heft::tools
