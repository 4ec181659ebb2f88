/// @file
/// The sources of this repository as text, for tests of the house itself.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace heft::test {

/// One source file.
struct SourceFile {
  std::filesystem::path path;  ///< from the repository's root, e.g. src/data/log.cpp
  std::vector<std::string> lines;
};

/// The lines of a file.
/// @param path  from the repository's root
inline std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::vector<std::string> lines;
  std::ifstream in(std::filesystem::path(HEFT_SOURCE_DIR) / path);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// All .hpp and .cpp files below some folders of the repository; a folder that is not there has none.
inline std::vector<SourceFile> sources_in(const std::vector<std::string>& folders) {
  namespace fs = std::filesystem;
  const fs::path root = HEFT_SOURCE_DIR;
  std::vector<SourceFile> files;
  for (const std::string& folder : folders) {
    if (!fs::exists(root / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".hpp" && extension != ".cpp") continue;
      const fs::path path = fs::relative(entry.path(), root);
      files.push_back({path, lines_of(path)});
    }
  }
  return files;
}

}  // namespace heft::test
