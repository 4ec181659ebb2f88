/// @file
/// Folders that a program fills.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

namespace heft::host {

/// A folder, made with its parents if it is not there. What was made and is still empty when the object goes (because
/// something failed) or when a signal ends the program is removed again.
class OutputFolder {
 public:
  /// @throws InputError when it cannot be made or is a file
  explicit OutputFolder(const std::string& path);
  ~OutputFolder();
  OutputFolder(OutputFolder&&) noexcept;
  OutputFolder& operator=(OutputFolder&&) noexcept;

  const std::filesystem::path& path() const { return path_; }
  /// Path of a file in it.
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  struct Made;
  std::filesystem::path path_;
  std::unique_ptr<Made> made_;
};

}  // namespace heft::host
