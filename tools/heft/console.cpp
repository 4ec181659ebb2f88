#include "console.hpp"

#include <algorithm>

#include <unistd.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"

namespace heft::tools {

void note(const std::string& text) { fmt::print(stderr, "heft: note: {}\n", text); }

Progress::Progress(std::string label)
    : label_(std::move(label)),
      terminal_(::isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (shown_) fmt::print(stderr, "\r\033[K");
}

void Progress::update(double done, const std::string& what) {
  if (!terminal_) return;
  const int percent = static_cast<int>(100.0 * std::clamp(done, 0.0, 1.0));
  if ((percent == last_percent_ && what == last_what_) ||
      std::chrono::steady_clock::now() - start_ < std::chrono::seconds(1))
    return;
  last_percent_ = percent;
  last_what_ = what;
  shown_ = true;
  fmt::print(stderr, "\r\033[K{}{}{} {:3d} %", label_, what.empty() ? "" : ": ", what, percent);
  std::fflush(stderr);
}

void write_json(const std::string& path, const nlohmann::ordered_json& json) {
  if (!path.empty()) host::write_file_atomically(path, json.dump(2) + "\n");
}

}  // namespace heft::tools
