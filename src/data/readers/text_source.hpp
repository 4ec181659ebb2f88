/// @file
/// Bytes of a text file from front to back; what gzip packed is unpacked.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "heft/host/file.hpp"

namespace heft::data {

class TextSource {
 public:
  /// @param path  for messages
  /// @param live  read() returns what is there instead of waiting for more; nothing is unpacked
  TextSource(host::InputFile file, std::string path, bool live);
  ~TextSource();

  /// @return number of bytes put into `to`, 0 at the end
  /// @throws DataError when reading fails, or for a gzip file that is damaged or cut
  std::size_t read(char* to, std::size_t room);
  /// Part of the file that was read, 0..1; 0 where its size is not known.
  double part_read() const;
  bool is_gzip() const { return unpack_ != nullptr; }

 private:
  struct Unpack;
  std::size_t read_file(char* to, std::size_t room);
  std::size_t unpack(char* to, std::size_t room);

  host::InputFile file_;
  std::string path_;
  bool live_{false};
  bool looked_{false};  ///< at the first bytes, whether gzip made them
  double file_size_{0.0};
  double bytes_read_{0.0};
  std::unique_ptr<Unpack> unpack_;
};

}  // namespace heft::data
