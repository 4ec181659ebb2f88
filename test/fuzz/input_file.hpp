/// @file
/// The input of a fuzzer as a file, and the end of the process when something is wrong with it.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include <unistd.h>

namespace heft::fuzz {

/// Ends the process: a fuzzer then keeps the input.
[[noreturn]] inline void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::abort();
}

/// A file that is there as long as this object.
class InputFile {
 public:
  /// @param ending  of its name, by which a map of columns is known
  explicit InputFile(std::string_view content, const std::string& ending = "")
      : path_((folder() / ("heft_fuzz_" + std::to_string(::getpid()) + ending)).string()) {
    std::FILE* file = std::fopen(path_.c_str(), "wb");
    if (file == nullptr || std::fwrite(content.data(), 1, content.size(), file) != content.size() ||
        std::fclose(file) != 0)
      give_up(path_ + ": cannot be written");
  }
  ~InputFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  /// In memory where there is such a folder.
  static std::filesystem::path folder() {
    const std::filesystem::path memory = "/dev/shm";
    return ::access(memory.c_str(), W_OK) == 0 ? memory : std::filesystem::temp_directory_path();
  }

  std::string path_;
};

}  // namespace heft::fuzz
