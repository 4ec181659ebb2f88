#include "heft/host/file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <unistd.h>

#include "heft/host/error.hpp"

namespace heft::host {

void write_file_atomically(const std::string& path, std::string_view content) {
  if (path == "-") {
    std::fwrite(content.data(), 1, content.size(), stdout);
    std::fflush(stdout);
    return;
  }
  // The temporary file sits in the same folder, so that rename stays within one file system.
  const std::string temporary = fmt::format("{}.tmp{}", path, ::getpid());
  {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    if (!out) {
      throw InputError(fmt::format("{}: cannot write: {}; check that the folder exists and is writable",
                                   path, std::strerror(errno)));
    }
    out.write(content.data(), static_cast<std::streamsize>(content.size()));
    out.flush();
    if (!out) {
      const std::string reason = std::strerror(errno);
      std::remove(temporary.c_str());
      throw InputError(fmt::format("{}: writing failed: {}; free some space or choose another folder", path, reason));
    }
  }
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) {
    std::remove(temporary.c_str());
    throw InputError(fmt::format("{}: cannot replace the file: {}", path, error.message()));
  }
}

std::string read_file(const std::string& path, std::string_view what) {
  if (std::filesystem::is_directory(path)) {
    throw InputError(fmt::format("{}: is a folder; expected a {} file", path, what));
  }
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw InputError(fmt::format("{}: cannot read the {}: {}; check the path", path, what, std::strerror(errno)));
  }
  std::ostringstream content;
  content << in.rdbuf();
  return content.str();
}

}  // namespace heft::host
