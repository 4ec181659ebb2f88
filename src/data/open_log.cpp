#include "open_log.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fmt/format.h>
#include <sys/stat.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::data {
namespace {

/// Bytes from the front of a file by which its format is known.
constexpr std::size_t kHead = std::size_t{1} << 16;

/// What the first bytes show; null: text.
const LogFormat* binary_format(std::FILE* file) {
  std::string head(kHead, '\0');
  head.resize(std::fread(head.data(), 1, head.size(), file));
  std::rewind(file);
  for (const LogFormat& format : binary_formats()) {
    if (format.recognises(head)) return &format;
  }
  return nullptr;
}

/// Every complaint names the file.
std::unique_ptr<LogReader> open_binary(const LogFormat& format, const std::string& path, const ReadAs& as) {
  try {
    return format.open(path, as);
  } catch (const DataError& error) {
    if (std::string_view(error.what()).starts_with(path)) throw;
    throw DataError(fmt::format("{}: {}", path, error.what()));
  }
}

std::unique_ptr<LogReader> open_any(const std::string& path, const ReadAs& as, Reading reading) {
  if (const LogFormat* format = folder_format(path)) return open_binary(*format, path, as);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw DataError(fmt::format("{}: is a folder; expected a log file", path));
  }
  host::InputFile file = host::open_input(path);
  if (!file) {
    throw DataError(fmt::format("{}: cannot read the log: {}; check the path", path, std::strerror(errno)));
  }
  struct stat status {};
  const bool is_file = ::fstat(::fileno(file.get()), &status) == 0 && S_ISREG(status.st_mode);
  if (is_file && reading == Reading::kWhole) {
    if (const LogFormat* format = binary_format(file.get())) {
      file.reset();
      return open_binary(*format, path, as);
    }
  }
  return std::make_unique<TextReader>(std::move(file), path, as, reading);
}

}  // namespace

std::unique_ptr<LogReader> open_log(const std::string& path, const ReadAs& as, Reading reading) {
  std::unique_ptr<LogReader> reader = open_any(path, as, reading);
  refuse_unused_map(reader->columns(), as, path);
  return reader;
}

}  // namespace heft::data
