/// Where the chunks of a data set are: by a B-tree of version 1 (MATLAB, h5py), or by one of the indexes of newer files.
#include <algorithm>
#include <bit>
#include <set>

#include "hdf5_file.hpp"

namespace heft::data {
namespace {

/// The chunks of a set in rows and columns, and what an entry of an index is.
class ChunkGrid {
 public:
  ChunkGrid(const Hdf5File& file, const Hdf5Set& set) : file_(file), set_(set) {
    const std::size_t axes = set.shape.size();
    // Numbers of chunks are by what the lengths may become. An axis without end comes first.
    for (std::size_t a = 0; a < axes; ++a) order_.push_back(a);
    const auto endless = std::find_if(order_.begin(), order_.end(),
                                      [&](std::size_t a) { return set.most[a] == kHdf5Nowhere; });
    if (endless != order_.end()) std::rotate(order_.begin(), endless, endless + 1);
    const std::optional<std::uint64_t> numbers = count_of(set.chunk);
    chunk_bytes_ = numbers && *numbers <= kLargestChunk / set.type.size ? *numbers * set.type.size : 0;
    if (chunk_bytes_ == 0) file.fail(set.at, "found chunks of more than {} bytes", kLargestChunk);
  }

  std::uint64_t chunk_bytes() const { return chunk_bytes_; }

  /// Chunks that the lengths have now; 0 where they are more than the file has bytes for.
  std::uint64_t most_chunks() const {
    std::vector<std::uint64_t> counts;
    for (std::size_t a = 0; a < order_.size(); ++a) counts.push_back(chunks_along(a, set_.most[a]));
    return count_of(counts).value_or(0);
  }

  /// The chunk of this number in an index, unless it is not there or beyond the set's present length.
  void add(std::uint64_t number, std::uint64_t at, std::uint64_t bytes, std::uint32_t without) {
    std::vector<std::uint64_t> scaled(order_.size());
    for (std::size_t k = order_.size(); k-- > 1;) {
      const std::uint64_t along = std::max<std::uint64_t>(1, chunks_along(order_[k], set_.most[order_[k]]));
      scaled[order_[k]] = number % along;
      number /= along;
    }
    if (!order_.empty()) scaled[order_[0]] = number;
    add(scaled, at, bytes, without);
  }
  /// @param scaled  its place, in chunks
  void add(const std::vector<std::uint64_t>& scaled, std::uint64_t at, std::uint64_t bytes,
           std::uint32_t without) {
    if (at == kHdf5Nowhere) return;
    Hdf5Chunk chunk{at, 0, without, {}};
    bool sticks_out = false;
    for (std::size_t a = 0; a < scaled.size(); ++a) {
      if (scaled[a] >= chunks_along(a, set_.shape[a])) return;
      chunk.begin.push_back(scaled[a] * set_.chunk[a]);
      sticks_out = sticks_out || set_.shape[a] - chunk.begin[a] < set_.chunk[a];
    }
    if (set_.bare_edges && sticks_out) {
      chunk.without = ~std::uint32_t{0};
      bytes = chunk_bytes_;
    }
    if (bytes > kLargestChunk) file_.fail(at, "found a chunk of {} bytes", bytes);
    chunk.bytes = static_cast<std::uint32_t>(bytes);
    chunks.push_back(std::move(chunk));
  }
  /// Entries of an array: an address, and where chunks are filtered their length and what they did not go through.
  void add_entries(std::string_view entries, std::size_t size, std::uint64_t first) {
    for (std::size_t k = 0; (k + 1) * size <= entries.size(); ++k) {
      const char* const entry = entries.data() + k * size;
      const bool is_filtered = size > 12;
      add(first + k, number_at<std::uint64_t>(entry),
          is_filtered ? hdf5_number(entry + 8, size - 12) : chunk_bytes_,
          is_filtered ? number_at<std::uint32_t>(entry + size - 4) : 0);
    }
  }

  std::vector<Hdf5Chunk> chunks;

 private:
  static constexpr std::uint64_t kLargestChunk = std::uint64_t{1} << 28;

  std::uint64_t chunks_along(std::size_t axis, std::uint64_t length) const {
    return length / set_.chunk[axis] + (length % set_.chunk[axis] != 0 ? 1 : 0);
  }

  const Hdf5File& file_;
  const Hdf5Set& set_;
  std::vector<std::size_t> order_;
  std::uint64_t chunk_bytes_{0};
};

/// Signature, version, client and the address of the head, in front of what an array's blocks hold.
constexpr std::uint64_t kBlockHead = 14, kChecksum = 4;

/// Size of an entry. @throws DataError for one that is none
std::size_t entry_size(const Hdf5File& file, std::uint64_t at, char stated) {
  const auto size = static_cast<std::size_t>(static_cast<unsigned char>(stated));
  if (size != 8 && (size < 13 || size > 20))
    file.fail(at, "found entries of {} bytes of an index of chunks", size);
  return size;
}

/// Reads a block that begins with its signature. @throws DataError for another
void expect_block(const Hdf5File& file, std::uint64_t at, std::string_view signature) {
  if (file.read(at, signature.size()) != signature) file.fail(at, "found no block of an index of chunks");
}

/// Entries in pages, each with a checksum behind it.
/// @param written    a bit a page: whether it is there
/// @param first_bit  that of the first page
void read_pages(const Hdf5File& file, std::uint64_t at, std::uint64_t entries, std::uint64_t page,
                std::size_t size, const std::string& written, std::uint64_t first_bit, std::uint64_t first,
                ChunkGrid& grid) {
  for (std::uint64_t k = 0; k * page < entries; ++k) {
    const std::uint64_t count = std::min(page, entries - k * page), bit = first_bit + k;
    const bool is_written = bit / 8 < written.size() && (written[bit / 8] & (0x80 >> (bit % 8))) != 0;
    if (is_written) grid.add_entries(file.read(at, count * size), size, first + k * page);
    at += count * size + kChecksum;
  }
}

/// As many entries as the set can have chunks, in pages where they are many.
void read_fixed_array(const Hdf5File& file, std::uint64_t header, ChunkGrid& grid) {
  const std::string head = file.read(header, 24);
  if (!head.starts_with("FAHD")) file.fail(header, "found no index of chunks");
  const std::size_t size = entry_size(file, header, head[6]);
  const std::uint64_t page = std::uint64_t{1} << (head[7] & 31),
                      entries = number_at<std::uint64_t>(head.data() + 8),
                      at = number_at<std::uint64_t>(head.data() + 16);
  if (at == kHdf5Nowhere) return;
  if (entries > file.bytes().size() / size)
    file.fail(header, "found {} chunks, more than the file has bytes for", entries);
  expect_block(file, at, "FADB");
  if (entries <= page) {
    grid.add_entries(file.read(at + kBlockHead, entries * size), size, 0);
    return;
  }
  const std::uint64_t bitmap = ((entries + page - 1) / page + 7) / 8;
  read_pages(file, at + kBlockHead + bitmap + kChecksum, entries, page, size,
             file.read(at + kBlockHead, bitmap), 0, 0, grid);
}

/// An array that grows along one axis: first entries in its index block, then in data blocks that become more and larger
/// ("super blocks": twice as many at every second, twice as large at the others), which the index block lists, or blocks
/// of addresses that it lists.
class ExtensibleArray {
 public:
  ExtensibleArray(const Hdf5File& file, std::uint64_t header, ChunkGrid& grid) : file_(file), grid_(grid) {
    const std::string head = file.read(header, 68);
    if (!head.starts_with("EAHD")) file.fail(header, "found no index of chunks");
    size_ = entry_size(file, header, head[6]);
    const auto setting = [&](std::size_t at) {
      return static_cast<std::uint64_t>(static_cast<unsigned char>(head[at]));
    };
    const std::uint64_t bits = setting(7), in_index = setting(8), pointers = setting(10);
    smallest_ = setting(9);
    page_ = std::uint64_t{1} << (setting(11) & 31);
    entries_ = number_at<std::uint64_t>(head.data() + 44);
    const std::uint64_t index = number_at<std::uint64_t>(head.data() + 60);
    if (bits > 64 || !std::has_single_bit(smallest_) || !std::has_single_bit(pointers) || pointers > 64)
      file.fail(header, "found an index of chunks that cannot be");
    if (index == kHdf5Nowhere) return;
    if (entries_ > file.bytes().size())
      file.fail(header, "found {} chunks, more than the file has bytes for", entries_);
    offset_bytes_ = (bits + 7) / 8;
    expect_block(file, index, "EAIB");
    grid.add_entries(file.read(index + kBlockHead, in_index * size_), size_, 0);
    first_ = in_index;
    const std::uint64_t blocks = index + kBlockHead + in_index * size_, listed = 2 * (pointers - 1);
    const auto supers_listed = static_cast<std::uint64_t>(2 * (std::bit_width(pointers) - 1));
    std::uint64_t block = 0;
    for (std::uint64_t super = 0; first_ < entries_; ++super) {
      const std::uint64_t count = std::uint64_t{1} << (super / 2);
      if (super < supers_listed) {
        read_blocks(blocks + 8 * block, super, {});
        block += count;
      } else {
        read_super_block(blocks + 8 * (listed + super - supers_listed), super);
      }
    }
  }

 private:
  std::uint64_t entries_in_block(std::uint64_t super) const { return smallest_ << ((super + 1) / 2); }

  void read_super_block(std::uint64_t pointer, std::uint64_t super) {
    const std::uint64_t at = number_at<std::uint64_t>(file_.read(pointer, 8).data()),
                        in_block = entries_in_block(super), count = std::uint64_t{1} << (super / 2);
    if (at == kHdf5Nowhere) {
      first_ += count * in_block;
      return;
    }
    expect_block(file_, at, "EASB");
    const std::uint64_t bitmap = in_block > page_ ? (in_block / page_ + 7) / 8 : 0;
    const std::uint64_t begin = at + kBlockHead + offset_bytes_;
    read_blocks(begin + count * bitmap, super, file_.read(begin, count * bitmap));
  }

  /// @param pointers  where the addresses of the blocks are
  /// @param written   which pages of them are, bit by bit
  void read_blocks(std::uint64_t pointers, std::uint64_t super, const std::string& written) {
    const std::uint64_t in_block = entries_in_block(super), count = std::uint64_t{1} << (super / 2),
                        head = kBlockHead + offset_bytes_;
    for (std::uint64_t k = 0; k < count && first_ < entries_; ++k, first_ += in_block) {
      const std::uint64_t at = number_at<std::uint64_t>(file_.read(pointers + 8 * k, 8).data());
      if (at == kHdf5Nowhere) continue;
      expect_block(file_, at, "EADB");
      if (in_block <= page_) {
        grid_.add_entries(file_.read(at + head, in_block * size_), size_, first_);
        continue;
      }
      // The bits of all blocks follow one another, though the room for them is a multiple of whole bytes a block.
      read_pages(file_, at + head + kChecksum, in_block, page_, size_, written, k * (in_block / page_),
                 first_, grid_);
    }
  }

  const Hdf5File& file_;
  ChunkGrid& grid_;
  std::size_t size_{8};
  std::uint64_t smallest_{1}, page_{1}, entries_{0}, offset_bytes_{0}, first_{0};
};

/// Sets that grow along several axes.
void read_tree(const Hdf5File& file, const Hdf5Set& set, ChunkGrid& grid) {
  const Hdf5Records records = records_of_tree(file, set.at);
  const std::size_t axes = set.shape.size(), bare = 8 + 8 * axes;
  if (records.count() > 0 && records.size != bare && (records.size < bare + 5 || records.size > bare + 12))
    file.fail(set.at, "found records of {} bytes of an index of chunks", records.size);
  for (std::size_t k = 0; k < records.count(); ++k) {
    const char* const record = records.bytes.data() + k * records.size;
    const std::size_t length_bytes = records.size == bare ? 0 : records.size - bare - 4;
    std::vector<std::uint64_t> scaled;
    for (std::size_t a = 0; a < axes; ++a)
      scaled.push_back(number_at<std::uint64_t>(record + records.size - 8 * (axes - a)));
    grid.add(scaled, number_at<std::uint64_t>(record),
             length_bytes == 0 ? grid.chunk_bytes() : hdf5_number(record + 8, length_bytes),
             length_bytes == 0 ? 0 : number_at<std::uint32_t>(record + 8 + length_bytes));
  }
}

void read_in_order(const Hdf5File& file, const Hdf5Set& set, ChunkGrid& grid) {
  const std::uint64_t count = grid.most_chunks();
  if (count == 0 || count > file.bytes().size() / grid.chunk_bytes())
    file.fail(set.at, "found more chunks than the file has bytes for");
  for (std::uint64_t k = 0; k < count; ++k)
    grid.add(k, set.at + k * grid.chunk_bytes(), grid.chunk_bytes(), 0);
}

/// B-tree of version 1.
std::vector<Hdf5Chunk> chunks_of_old_tree(const Hdf5File& file, const Hdf5Set& set) {
  constexpr std::size_t kNode = 24;
  const std::size_t axes = set.shape.size(), key = 8 + 8 * (axes + 1);
  std::vector<Hdf5Chunk> chunks;
  std::vector<std::uint64_t> nodes;
  if (set.at != kHdf5Nowhere) nodes.push_back(set.at);
  std::set<std::uint64_t> seen;
  while (!nodes.empty()) {
    const std::uint64_t at = nodes.back();
    nodes.pop_back();
    if (!seen.insert(at).second) file.fail(at, "found a tree of chunks that runs in circles");
    const std::string head = file.read(at, kNode);
    if (!head.starts_with("TREE") || head[4] != 1) file.fail(at, "found no node of a tree of chunks");
    const std::size_t count = number_at<std::uint16_t>(head.data() + 6);
    const std::string entries = file.read(at + kNode, count * (key + 8));
    for (std::size_t i = 0; i < count; ++i) {
      const char* const entry = entries.data() + i * (key + 8);
      const std::uint64_t child = number_at<std::uint64_t>(entry + key);
      if (head[5] != 0) {  // not a leaf
        nodes.push_back(child);
        continue;
      }
      Hdf5Chunk chunk;
      chunk.at = child;
      chunk.bytes = number_at<std::uint32_t>(entry);
      chunk.without = number_at<std::uint32_t>(entry + 4);
      if (chunks.size() > file.bytes().size() / key)
        file.fail(at, "found more chunks than the file has bytes for");
      for (std::size_t a = 0; a < axes; ++a)
        chunk.begin.push_back(number_at<std::uint64_t>(entry + 8 + 8 * a));
      chunks.push_back(std::move(chunk));
    }
  }
  return chunks;
}

}  // namespace

std::vector<Hdf5Chunk> Hdf5File::chunks_of(const Hdf5Set& set) const {
  if (set.index == Hdf5Index::kTree) return chunks_of_old_tree(*this, set);
  if (set.at == kHdf5Nowhere) return {};
  ChunkGrid grid(*this, set);
  switch (set.index) {
    case Hdf5Index::kSingle:
      grid.add(0, set.at, set.single_bytes > 0 ? set.single_bytes : grid.chunk_bytes(), set.single_without);
      break;
    case Hdf5Index::kInOrder: read_in_order(*this, set, grid); break;
    case Hdf5Index::kFixedArray: read_fixed_array(*this, set.at, grid); break;
    case Hdf5Index::kExtensibleArray: ExtensibleArray(*this, set.at, grid); break;
    case Hdf5Index::kTree2:
    case Hdf5Index::kTree: read_tree(*this, set, grid);
  }
  return grid.chunks;
}

}  // namespace heft::data
