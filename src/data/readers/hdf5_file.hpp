/// @file
/// The structure of an HDF5 file ("HDF5 File Format Specification", versions 1.1 and 3.0, The HDF Group). Read here rather
/// than by the library, which does not stand damaged files. What MATLAB's version 7.3 writes, and h5py unless told otherwise:
/// superblock of version 0, groups by symbol tables, object headers of version 1, chunks in a B-tree of version 1. What
/// h5py's libver='latest' writes: superblock of version 2 or 3, groups by links (hdf5_links.cpp), object headers of version
/// 2, chunks by the other five indexes (hdf5_chunks.cpp).
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
  kHdf5LinkInfo = 0x02,
  kHdf5Datatype = 0x03,
  kHdf5Link = 0x06,
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

/// How the chunks of a data set are found.
enum class Hdf5Index : std::uint8_t { kTree, kSingle, kInOrder, kFixedArray, kExtensibleArray, kTree2 };

struct Hdf5Set {
  std::vector<std::uint64_t> shape, most;  ///< lengths now, and what they may become
  NumberType type;
  bool chunked{false};
  std::uint64_t at{0};  ///< of the numbers, or of the tree of chunks
  std::uint64_t bytes{0};
  std::vector<std::uint64_t> chunk;  ///< lengths of one
  Hdf5Index index{Hdf5Index::kTree};
  std::uint64_t single_bytes{0};       ///< of the only chunk, where it is filtered
  std::uint32_t single_without{0};     ///< as Hdf5Chunk::without
  bool bare_edges{false};              ///< chunks that stick out of the set are not filtered
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
  /// Whether an object with these messages is a group.
  static bool is_group(const std::vector<Hdf5Message>& messages);
  /// Objects of a group, sorted: names and headers.
  std::vector<std::pair<std::string, std::uint64_t>> objects_in(const std::vector<Hdf5Message>& group) const;
  /// Every chunk of a data set that was written. @throws DataError where the index does not hold together
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
  using Objects = std::vector<std::pair<std::string, std::uint64_t>>;

  void find_root();
  std::vector<Hdf5Message> messages_of_old(std::uint64_t header, const std::string& head) const;
  std::vector<Hdf5Message> messages_of_new(std::uint64_t header) const;
  std::string name_at(std::uint64_t heap, std::uint64_t offset) const;
  void add_symbols(const Hdf5Message& table, Objects& to) const;
  void add_link(std::uint64_t at, std::string_view link, Objects& to) const;
  void add_heap_of_links(const Hdf5Message& info, Objects& to) const;

  SharedBytes file_;
  std::uint64_t base_{0}, root_{0};
};

/// A whole number of 1 to 8 bytes, least first.
std::uint64_t hdf5_number(const char* at, std::size_t bytes);

/// Records of a B-tree of version 2, in order.
struct Hdf5Records {
  std::size_t size{0};  ///< of one [bytes]
  std::string bytes;
  std::size_t count() const { return size == 0 ? 0 : bytes.size() / size; }
};
/// @throws DataError where the tree does not hold together
Hdf5Records records_of_tree(const Hdf5File& file, std::uint64_t header);

}  // namespace heft::data
