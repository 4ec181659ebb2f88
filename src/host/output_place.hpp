/// @file
/// Where an output path leads, and the file that is written before it is renamed.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <sys/stat.h>
#include <unistd.h>

#include "temporaries.hpp"

namespace heft::host {

/// A descriptor that is closed in the end.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(Descriptor&& other) noexcept : number_(other.number_) { other.number_ = -1; }
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }

  explicit operator bool() const { return number_ >= 0; }
  int get() const { return number_; }
  int release() { return std::exchange(number_, -1); }
  int close() { return number_ >= 0 ? ::close(std::exchange(number_, -1)) : 0; }

 private:
  int number_{-1};
};

/// A file in a folder, gone when the object goes or a signal ends the process, unless it was renamed.
class ScratchFile {
 public:
  explicit ScratchFile(int folder);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// errno of the attempt to make it, 0 when it is there
  int error() const { return file_ ? 0 : error_; }
  int descriptor() const { return file_.get(); }
  /// Closes it and gives it its name in the folder. @return 0 or errno; it is gone then
  int rename_to(const std::string& name);

 private:
  int folder_;
  std::string name_;
  std::optional<Temporary> entry_;
  Descriptor file_;
  int error_{0};
};

struct OutputPlace {
  std::optional<int> descriptor;  ///< of this process; nothing below then counts but `status`
  std::string target;             ///< links followed
  std::string folder, name;       ///< of the target
  bool exists{false};
  struct stat status {};  ///< when it exists

  /// A file that nobody may write. For root, who may, this is what it was protected for.
  bool is_protected() const {
    return exists && S_ISREG(status.st_mode) &&
           ((status.st_mode & 0222) == 0 || ::access(target.c_str(), W_OK) != 0);
  }
};

/// @return 0, or why not all could be written
int write_all(int descriptor, std::string_view content);

/// @throws InputError for a folder, a socket, and what the system cannot look up
OutputPlace output_place(const std::string& path);

}  // namespace heft::host
