#include "console.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <unistd.h>

#include "heft/host/file.hpp"
#include "text_layout.hpp"

namespace heft::tools {

namespace {

constexpr int kUnlimited = 1 << 20;

/// errno of the first write that failed, by stream: standard output, standard error.
std::array<int, 2> first_failure{};

void remember(std::FILE* stream, int reason) noexcept {
  int& first = first_failure[stream == stderr ? 1 : 0];
  if (first == 0) first = reason != 0 ? reason : EIO;
}

}  // namespace

void print_to(std::FILE* stream, const std::string& text) noexcept {
  // Redirected text stays as it is: other programs read it line by line.
  const bool terminal = ::isatty(::fileno(stream)) != 0;
  errno = 0;
  if (std::fputs(terminal ? wrapped(text, terminal_width(stream, kUnlimited)).c_str() : text.c_str(),
                 stream) < 0)
    remember(stream, errno);
}

std::string lost_output() noexcept {
  for (std::FILE* stream : {stdout, stderr}) {
    errno = 0;
    if (std::fflush(stream) != 0) remember(stream, errno);
  }
  const auto text = [](const char* name, int reason) {
    return fmt::format("{}: results could not be written: {}; {}", name, std::strerror(reason),
                       reason == ENOSPC ? "free some space or send them elsewhere" : "check where it goes");
  };
  if (first_failure[0] != 0) return text("standard output", first_failure[0]);
  if (first_failure[1] != 0) return text("standard error", first_failure[1]);
  return {};
}

bool reader_left() noexcept { return first_failure[0] == EPIPE; }

namespace {
bool standard_output_is_taken = false;
}

void Console::leave_standard_output() noexcept { standard_output_is_taken = true; }

Console::Console(std::initializer_list<std::string> outputs) {
  if (standard_output_is_taken) stream_ = stderr;
  for (const std::string& path : outputs) {
    if (host::is_standard_output(path)) stream_ = stderr;
  }
}

void warn(const std::string& text) { print_to(stderr, fmt::format("heft: warning: {}\n", text)); }

void note(const std::string& text) { print_to(stderr, fmt::format("heft: note: {}\n", text)); }

Progress::Progress(std::string label)
    : label_(std::move(label)),
      terminal_(::isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()),
      last_line_(start_) {}

Progress::~Progress() {
  if (shown_) print_to(stderr, "\r\033[K");
}

void Progress::update(double done, const std::string& what) {
  using std::chrono::seconds;
  const int percent = std::max(last_percent_, static_cast<int>(100.0 * std::clamp(done, 0.0, 1.0)));
  const auto now = std::chrono::steady_clock::now();
  const std::string text =
      fmt::format("{}{}{} {:{}d} %", label_, what.empty() ? "" : ": ", what, percent, terminal_ ? 3 : 0);
  if (!terminal_) {
    last_percent_ = percent;
    if (now - last_line_ < seconds(10)) return;
    last_line_ = now;
    print_to(stderr, fmt::format("heft: {} after {} s\n", text,
                                 std::chrono::duration_cast<seconds>(now - start_).count()));
    return;
  }
  if ((percent == last_percent_ && what == last_what_) || now - start_ < seconds(1)) return;
  last_percent_ = percent;
  last_what_ = what;
  shown_ = true;
  print_to(stderr, "\r\033[K" + text);
  std::fflush(stderr);
}

void write_json(const std::string& path, const std::string& json) {
  if (!path.empty()) host::write_file_atomically(path, json + "\n");
}

}  // namespace heft::tools
