/// @file
/// What people see: results on standard output, notes and progress on standard error.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

namespace heft::tools {

/// The stream for results. It is standard error when standard output carries a file (`-o -`, `--json -`).
class Console {
 public:
  /// @param outputs  the paths that the command writes to
  Console(std::initializer_list<std::string> outputs) {
    for (const std::string& path : outputs) {
      if (path == "-") stream_ = stderr;
    }
  }
  template <typename... Args>
  void print(fmt::format_string<Args...> format, Args&&... args) const {
    fmt::print(stream_, format, std::forward<Args>(args)...);
  }

 private:
  std::FILE* stream_{stdout};
};

/// A line on standard error: `heft: note: ...`.
void note(const std::string& text);

/// One line on standard error that counts up, on a terminal only and only when it takes over a second.
class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// @param done  0..1
  /// @param what  stands behind the label; may be empty
  void update(double done, const std::string& what = {});

 private:
  std::string label_;
  bool terminal_;
  bool shown_{false};
  int last_percent_{-1};
  std::string last_what_;
  std::chrono::steady_clock::time_point start_;
};

/// Writes a JSON result; whole or not at all. `-` is standard output; nothing happens for an empty path.
void write_json(const std::string& path, const nlohmann::ordered_json& json);

}  // namespace heft::tools
