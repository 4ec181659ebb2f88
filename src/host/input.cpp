#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "output_place.hpp"

namespace heft::host {
namespace {

/// Descriptors of the copies, by the path that was given.
std::map<std::string, int>& spooled() {
  static std::map<std::string, int> copies;
  return copies;
}

/// A path that the system can open.
std::string system_path(const std::string& path) { return path == "-" ? "/dev/stdin" : path; }

/// An unnamed file: on the disk, in memory where no folder for temporary files can be written.
Descriptor unnamed_file() {
  const char* const folder = std::getenv("TMPDIR");
  std::string pattern = std::string(folder != nullptr && *folder != '\0' ? folder : "/tmp") + "/.heft-XXXXXX";
  Descriptor file(::mkostemp(pattern.data(), O_CLOEXEC));
  if (file) {
    ::unlink(pattern.c_str());
    return file;
  }
  return Descriptor(::memfd_create("heft", MFD_CLOEXEC));
}

[[noreturn]] void refuse(const std::string& path, std::string_view what, const std::string& found,
                         const std::string& remedy) {
  throw InputError(fmt::format("{}: cannot read the {}: {}; {}", path, what, found, remedy));
}

/// @param endless  `from` is a device such as /dev/zero, which may have no end
void copy(const std::string& path, std::string_view what, int from, int to, bool endless) {
  // Some binary formats begin with zeros, none with as many.
  constexpr std::size_t kMostZeros = std::size_t{1} << 16;
  std::array<char, 1 << 16> block{};
  std::size_t zeros = 0;
  bool only_zeros = true;
  for (;;) {
    const ssize_t count = ::read(from, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) refuse(path, what, std::strerror(errno), "check what writes to it");
    if (count == 0) return;
    const auto got = static_cast<std::size_t>(count);
    if (endless && std::memchr(block.data(), '\0', got) != nullptr) {
      refuse(path, what, "found a zero byte in a device", "expected text, or a binary format through a pipe");
    }
    only_zeros =
        only_zeros && std::all_of(block.data(), block.data() + got, [](char c) { return c == '\0'; });
    zeros = only_zeros ? zeros + got : 0;
    if (zeros >= kMostZeros) {
      refuse(path, what, fmt::format("found nothing but zero bytes in the first {} kB", kMostZeros >> 10),
             "check what writes to it");
    }
    for (ssize_t done = 0; done < count;) {
      const ssize_t written = ::write(to, block.data() + done, static_cast<std::size_t>(count - done));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) {
        refuse(path, what, fmt::format("no space for a copy ({})", std::strerror(errno)),
               "store it as a file, or let TMPDIR name a folder with more space");
      }
      done += written;
    }
  }
}

}  // namespace

InputFile open_input(const std::string& path) {
  const auto copy = spooled().find(path);
  if (copy == spooled().end()) return InputFile(std::fopen(system_path(path).c_str(), "rbe"));
  // Opened again rather than duplicated: every reader has its own place in the file.
  return InputFile(std::fopen(fmt::format("/proc/self/fd/{}", copy->second).c_str(), "rbe"));
}

InputFile temporary_file() {
  Descriptor file = unnamed_file();
  InputFile opened(file ? ::fdopen(file.get(), "w+b") : nullptr);
  if (opened) file.release();
  return opened;
}

void spool_input(const std::string& path, std::string_view what) {
  if (spooled().contains(path)) {
    refuse(path, what, "it was given before, and a pipe can be read once only", "name it once");
  }
  struct stat status {};
  const std::string name = system_path(path);
  if (::stat(name.c_str(), &status) != 0 || S_ISDIR(status.st_mode) || S_ISBLK(status.st_mode)) return;
  if (S_ISREG(status.st_mode) && path != "-") return;
  // A socket cannot be opened by its name, so descriptors of this process are doubled.
  const std::optional<int> named = named_descriptor(name);
  const Descriptor from(named ? ::dup(*named) : ::open(name.c_str(), O_RDONLY | O_CLOEXEC));
  if (!from) return;  // the reader says why, in its own words
  Descriptor to = unnamed_file();
  if (!to) refuse(path, what, "no temporary file for a copy", "store it as a file and name that");
  const bool endless = S_ISCHR(status.st_mode) && ::isatty(from.get()) == 0;
  copy(path, what, from.get(), to.get(), endless);
  spooled()[path] = to.release();
}

std::string read_file(const std::string& path, std::string_view what) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) {
    throw InputError(fmt::format("{}: is a folder; expected a {} file", path, what));
  }
  const InputFile file = open_input(path);
  if (!file) refuse(path, what, std::strerror(errno), "check the path");
  std::string content;
  std::array<char, 1 << 16> block{};
  while (const std::size_t count = std::fread(block.data(), 1, block.size(), file.get()))
    content.append(block.data(), count);
  if (std::ferror(file.get()) != 0) refuse(path, what, std::strerror(errno), "check the disk");
  return content;
}

void refuse_deep_json(std::string_view text, const std::string& file) {
  constexpr int kDeepest = 100;
  int depth = 0;
  bool in_string = false;
  std::size_t line = 1, line_start = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '\n') {
      ++line;
      line_start = at + 1;
    }
    if (in_string) {
      if (c == '\\') ++at;
      in_string = c != '"';
      continue;
    }
    if (c == '"') in_string = true;
    // Comments, where a reader takes them, may hold quotes.
    if (c == '/' && at + 1 < text.size() && text[at + 1] == '/')
      at = std::min(text.find('\n', at), text.size()) - 1;
    if (c == '/' && at + 1 < text.size() && text[at + 1] == '*')
      at = std::min(text.find("*/", at), text.size());
    if (c == ']' || c == '}') --depth;
    if (c != '[' && c != '{') continue;
    if (++depth > kDeepest) {
      throw ModelError(fmt::format(
          "{}:{}:{}: found brackets nested more than {} deep; expected at most the ten levels or so that "
          "a file of heft has; this is not a file that heft can use",
          file, line, at - line_start + 1, kDeepest));
    }
  }
}

}  // namespace heft::host
