/// @file
/// An output file that is written piece by piece and appears whole or not at all.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace heft::host {

/// As write_file_atomically(), for what is too long for the memory. Without finish() a regular file stays as it was, also
/// when a signal ends the process; what is written through (standard output, a pipe, a device) is gone with write().
class FileWriter {
 public:
  /// @throws InputError when the file cannot be written
  explicit FileWriter(const std::string& path);
  ~FileWriter();

  /// @throws InputError, ReaderLeftError
  void write(std::string_view content);
  /// The file has all of it now. @throws InputError
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::host
