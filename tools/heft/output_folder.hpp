/// @file
/// Folders that a command fills.
#pragma once

#include <filesystem>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::tools {

/// The folder, made with its parents if it is not there.
/// @throws InputError when it cannot be made or is a file
inline std::filesystem::path make_output_folder(const std::string& path) {
  std::error_code failure;
  std::filesystem::create_directories(path, failure);
  if (failure || !std::filesystem::is_directory(path)) {
    throw InputError(fmt::format(
        "{}: found {}, expected a folder that can be made or written to; give another one with -o", path,
        failure ? failure.message() : "a file of this name"));
  }
  return path;
}

}  // namespace heft::tools
