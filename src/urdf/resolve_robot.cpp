#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::urdf {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

void append_folders(std::string_view list, std::vector<std::string>& folders) {
  while (!list.empty()) {
    const std::size_t colon = list.find(':');
    if (const std::string_view folder = list.substr(0, colon); !folder.empty()) folders.emplace_back(folder);
    if (colon == std::string_view::npos) return;
    list.remove_prefix(colon + 1);
  }
}

/// Where an installation has its robots, seen from the program that runs: it may be copied or moved as a whole.
std::string installed_beside_program() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error) return {};
  const fs::path folder = (program.parent_path() / HEFT_ROBOTS_FROM_PROGRAM).lexically_normal();
  return fs::is_directory(folder, error) ? folder.string() : std::string();
}

/// Where robots are looked for, first come first.
std::vector<std::string> robot_folders() {
  std::vector<std::string> folders;
  if (const char* listed = std::getenv("HEFT_URDF_PATH"); listed != nullptr) append_folders(listed, folders);
  if (std::string installed = installed_beside_program(); !installed.empty())
    folders.push_back(std::move(installed));
  append_folders(HEFT_ROBOT_FOLDERS, folders);
  return folders;
}

std::vector<std::string> robots_in(const std::vector<std::string>& folders) {
  std::vector<std::string> names;
  for (const std::string& folder : folders) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
      if (entry->path().extension() == ".urdf") names.push_back(entry->path().stem().string());
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

}  // namespace

std::string resolve_robot(const std::string& name_or_path) {
  if (name_or_path.empty())
    throw UrdfError("no robot was named; expected the path of a URDF or a name such as ur5e");
  if (is_file(name_or_path)) return name_or_path;
  std::error_code error;
  // A pipe such as <(xacro arm.xacro).
  const fs::file_status status = fs::status(name_or_path, error);
  if (fs::is_fifo(status) || fs::is_character_file(status)) return name_or_path;
  const bool is_name = name_or_path.find('/') == std::string::npos;
  if (fs::is_directory(name_or_path, error) && !is_name) {
    throw UrdfError(fmt::format("{}: is a folder; expected a URDF file; name the file in it", name_or_path));
  }
  if (!is_name) {
    throw UrdfError(fmt::format("{}: there is no such file; expected a URDF; check the path", name_or_path));
  }
  const std::vector<std::string> folders = robot_folders();
  for (const std::string& folder : folders) {
    for (const char* extension : {"", ".urdf"}) {
      const fs::path candidate = fs::path(folder) / (name_or_path + extension);
      if (is_file(candidate)) return candidate.string();
    }
  }
  throw UrdfError(
      fmt::format("{}: no such file and no robot of that name; known robots: {}; searched {}; "
                  "check the spelling, give a path, or add a folder to HEFT_URDF_PATH",
                  name_or_path, fmt::join(robots_in(folders), ", "), fmt::join(folders, ", ")));
}

std::vector<std::string> robot_names() { return robots_in(robot_folders()); }

std::string resolve_measurements(const std::string& name) {
  const std::vector<std::string> folders = robot_folders();
  for (const std::string& folder : folders) {
    if (const fs::path candidate = fs::path(folder) / name; is_file(candidate)) return candidate.string();
  }
  throw DataError(
      fmt::format("{}: measurements that come with heft were not found; searched {}; install heft as a "
                  "whole or add the folder that holds them to HEFT_URDF_PATH",
                  name, fmt::join(folders, ", ")));
}

}  // namespace heft::urdf
