/// @file
/// The structure of an HDF5 file: what MATLAB's version 7.3 writes, and h5py unless told otherwise ("HDF5 File Format
/// Specification", version 1.1, The HDF Group). Read here rather than by the library, which does not stand damaged files: the
/// superblock of versions 0 and 1, groups by symbol tables, object headers of version 1.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"

namespace heft::data {

inline constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";

/// The address that says that there is nothing.
inline constexpr std::uint64_t kHdf5Nowhere = ~std::uint64_t{0};

/// Most objects of a file that are looked at.
inline constexpr std::size_t kMostHdf5Objects = 5000;

/// Messages in an object's header.
enum Hdf5Kind : std::uint16_t {
  kHdf5Dataspace = 0x01,
  kHdf5Datatype = 0x03,
  kHdf5Layout = 0x08,
  kHdf5Filters = 0x0B,
  kHdf5Attribute = 0x0C,
  kHdf5Continuation = 0x10,
  kHdf5SymbolTable = 0x11
};

struct Hdf5Message {
  std::uint16_t kind{0};
  bool shared{false};   ///< kept elsewhere
  std::uint64_t at{0};  ///< of the content, in the file
  std::string content;
};

struct Hdf5Chunk {
  std::uint64_t at{0};
  std::uint32_t bytes{0};
  std::uint32_t without{0};  ///< filters that it did not go through, by bits
  std::vector<std::uint64_t> begin;
};

struct Hdf5Set {
  std::vector<std::uint64_t> shape;
  NumberType type;
  bool chunked{false};
  std::uint64_t at{0};  ///< of the numbers, or of the tree of chunks
  std::uint64_t bytes{0};
  std::vector<std::uint64_t> chunk;    ///< lengths of one
  std::vector<std::uint16_t> filters;  ///< in the order in which they were applied
  std::string unusable;
  std::string matlab;  ///< class
};

class Hdf5File {
 public:
  explicit Hdf5File(SharedBytes file) : file_(std::move(file)) { find_root(); }

  std::uint64_t root() const { return root_; }
  const InputBytes& bytes() const { return *file_; }
  const SharedBytes& shared() const { return file_; }
  std::uint64_t base() const { return base_; }
  std::vector<Hdf5Message> messages_of(std::uint64_t header) const;
  /// Objects of a group: names and headers.
  std::vector<std::pair<std::string, std::uint64_t>> objects_in(const Hdf5Message& table) const;
  std::vector<Hdf5Chunk> chunks_of(const Hdf5Set& set) const;
  std::string read(std::uint64_t at, std::uint64_t count) const {
    if (at > bytes().size() || !bytes().has(base_ + at, count)) {
      fail(at, "found {} bytes that lead beyond the end of the file (it has {})", count, bytes().size());
    }
    std::string block(static_cast<std::size_t>(count), '\0');
    file_->read(base_ + at, block.data(), block.size());
    return block;
  }
  template <typename... Args>
  [[noreturn]] void fail(std::uint64_t at, fmt::format_string<Args...> format, Args&&... args) const {
    file_->fail(at == kHdf5Nowhere ? 0 : base_ + at, "{}; the file is damaged or was cut",
                fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  void find_root();
  std::string name_at(std::uint64_t heap, std::uint64_t offset) const;

  SharedBytes file_;
  std::uint64_t base_{0}, root_{0};
};

}  // namespace heft::data
