#include "gnuplot.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace heft::page {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string read_all(std::FILE* file) {
  std::string text;
  std::rewind(file);
  char buffer[65536];
  while (const std::size_t count = std::fread(buffer, 1, sizeof buffer, file)) text.append(buffer, count);
  return text;
}

}  // namespace

GnuplotResult run_gnuplot(const std::string& script) {
  GnuplotResult result;
  // Unnamed temporary files instead of pipes: neither side can block on the other or be killed by a
  // closed pipe, and nothing is left behind.
  const File input(std::tmpfile());
  const File output(std::tmpfile());
  const File error(std::tmpfile());
  if (!input || !output || !error ||
      std::fwrite(script.data(), 1, script.size(), input.get()) != script.size() ||
      std::fflush(input.get()) != 0) {
    result.error = fmt::format("no temporary file for gnuplot: {}", std::strerror(errno));
    return result;
  }
  std::rewind(input.get());

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ::fileno(input.get()), 0);
  posix_spawn_file_actions_adddup2(&actions, ::fileno(output.get()), 1);
  posix_spawn_file_actions_adddup2(&actions, ::fileno(error.get()), 2);
  // --default-settings: a user's own gnuplot settings must not change a report.
  char name[] = "gnuplot";
  char settings[] = "--default-settings";
  char* arguments[] = {name, settings, nullptr};
  pid_t child = 0;
  const int status = ::posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (status == ENOENT) {
    result.error = "gnuplot was not found; install it (Debian: apt-get install gnuplot-nox) to see the plots";
    return result;
  }
  if (status != 0) {
    result.error = fmt::format("gnuplot could not be started: {}", std::strerror(status));
    return result;
  }
  int exit_status = 0;
  while (::waitpid(child, &exit_status, 0) < 0 && errno == EINTR) {
  }
  result.output = read_all(output.get());
  if (!WIFEXITED(exit_status) || WEXITSTATUS(exit_status) != 0 || result.output.empty()) {
    std::string reason = read_all(error.get());
    if (reason.size() > 400) reason.resize(400);
    result.error = fmt::format("gnuplot failed: {}", reason.empty() ? "no output" : reason);
    return result;
  }
  result.ok = true;
  result.remarks = read_all(error.get());
  return result;
}

}  // namespace heft::page
