/// @file
/// A file read at any place. Every length that a file states is checked against what the file has before memory is
/// taken for it.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::data {

class InputBytes {
 public:
  /// @throws DataError when it cannot be opened
  explicit InputBytes(const std::string& path);
  /// A file that is open, named `path` in messages.
  InputBytes(host::InputFile file, const std::string& path);

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  int descriptor() const;
  bool has(std::uint64_t at, std::uint64_t count) const { return at <= size_ && count <= size_ - at; }
  /// Reads `count` bytes at byte `at`. @throws DataError when the file has fewer
  void read(std::uint64_t at, void* to, std::size_t count) const;
  /// As many of `count` bytes as the file has there.
  std::size_t read_some(std::uint64_t at, void* to, std::size_t count) const;

  /// @throws DataError "run.mcap: byte 1234: found ...; expected ...; what to do"
  template <typename... Args>
  [[noreturn]] void fail(std::uint64_t at, fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(
        fmt::format("{}: byte {}: {}", path_, at, fmt::format(format, std::forward<Args>(args)...)));
  }

 private:
  std::string path_;
  host::InputFile file_;
  std::uint64_t size_{0};
};

/// The same file for several readers, each with its own place in it.
using SharedBytes = std::shared_ptr<const InputBytes>;

/// A number from bytes at any address.
template <typename T>
T number_at(const char* at, bool swapped = false) {
  static_assert(std::endian::native == std::endian::little);
  unsigned char bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
  if (swapped) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
  }
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// Bytes from front to back.
class ByteStream {
 public:
  virtual ~ByteStream() = default;
  /// @throws DataError when there are fewer
  virtual void read(char* to, std::size_t count) = 0;
  virtual void skip(std::uint64_t count) = 0;
  /// Another one at the same place.
  virtual std::unique_ptr<ByteStream> copy() const = 0;
};

/// Bytes of a part of a file as they are. @throws DataError when the file does not have that part
std::unique_ptr<ByteStream> plain_stream(SharedBytes file, std::uint64_t at, std::uint64_t count);
/// Bytes of a part of a file inflated. `raw`: without the header and checksum of zlib, as in zip files.
std::unique_ptr<ByteStream> inflated_stream(SharedBytes file, std::uint64_t at, std::uint64_t count,
                                            bool raw);

/// A file compressed as a whole by zstd, decompressed into an unnamed temporary file.
/// @throws DataError when it is damaged, or grows beyond what a recording can
host::InputFile decompress_zstd(const InputBytes& file);

}  // namespace heft::data
