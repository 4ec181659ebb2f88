/// Groups of newer HDF5 files: links in the group's header, or, where there are many, in a heap beside it that a tree of
/// names leads into. Also B-trees of version 2.
#include <algorithm>
#include <bit>
#include <set>

#include "hdf5_file.hpp"

namespace heft::data {
namespace {

/// Nodes of a tree, and levels of it: more than any log has.
constexpr std::size_t kMostTreeNodes = 20000, kMostLevels = 8;

/// Signature, version and kind in front of a node, and the checksum behind it.
constexpr std::size_t kNodeHead = 6, kNodeFrame = 10;

/// Bytes that hold numbers up to `most`.
std::size_t bytes_for(std::uint64_t most) {
  return most == 0 ? 1 : (static_cast<std::size_t>(std::bit_width(most)) + 7) / 8;
}

/// B-tree of version 2. Inner nodes hold records too; how wide their counts are follows from how many fit into a node.
class RecordTree {
 public:
  RecordTree(const Hdf5File& file, std::uint64_t header) : file_(file) {
    const std::string head = file.read(header, 38);
    if (!head.starts_with("BTHD")) file.fail(header, "found no head of a tree");
    node_bytes_ = number_at<std::uint32_t>(head.data() + 6);
    records_.size = number_at<std::uint16_t>(head.data() + 10);
    const std::size_t depth = number_at<std::uint16_t>(head.data() + 12);
    if (records_.size == 0 || node_bytes_ < kNodeFrame + records_.size || node_bytes_ > kLargestNode ||
        depth > kMostLevels) {
      file.fail(header, "found a tree of {} levels with nodes of {} bytes and records of {}", depth,
                node_bytes_, records_.size);
    }
    measure(header, depth);
    const std::uint64_t root = number_at<std::uint64_t>(head.data() + 16);
    if (root != kHdf5Nowhere) take(root, number_at<std::uint16_t>(head.data() + 24), depth);
  }

  Hdf5Records records() && { return std::move(records_); }

 private:
  static constexpr std::size_t kLargestNode = std::size_t{1} << 20;

  /// How wide the counts of a child are at each level, leaves first.
  void measure(std::uint64_t header, std::size_t depth) {
    std::uint64_t most = (node_bytes_ - kNodeFrame) / records_.size, all = most;
    count_bytes_ = bytes_for(most);
    all_bytes_.assign(1, 0);
    for (std::size_t level = 1; level <= depth; ++level) {
      const std::size_t pointer = pointer_bytes(level);
      if (node_bytes_ < kNodeFrame + pointer) file_.fail(header, "found nodes of {} bytes", node_bytes_);
      most = (node_bytes_ - kNodeFrame - pointer) / (records_.size + pointer);
      constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
      all = all > kMost / (most + 1) ? kMost : (most + 1) * all + most;
      all_bytes_.push_back(bytes_for(all));
    }
  }
  std::size_t pointer_bytes(std::size_t level) const { return 8 + count_bytes_ + all_bytes_[level - 1]; }

  void take(std::uint64_t at, std::size_t count, std::size_t level) {
    if (!seen_.insert(at).second || seen_.size() > kMostTreeNodes)
      file_.fail(at, "found a tree that runs in circles");
    const std::size_t pointers = level == 0 ? 0 : (count + 1) * pointer_bytes(level);
    if (kNodeHead + count * records_.size + pointers > node_bytes_)
      file_.fail(at, "found {} records in a node of {} bytes", count, node_bytes_);
    const std::string node = file_.read(at, kNodeHead + count * records_.size + pointers);
    if (!node.starts_with(level == 0 ? "BTLF" : "BTIN")) file_.fail(at, "found no node of a tree");
    records_.bytes.append(node, kNodeHead, count * records_.size);
    if (records_.bytes.size() > file_.bytes().size())
      file_.fail(at, "found more records than the file has bytes for");
    for (std::size_t k = 0; level > 0 && k <= count; ++k) {
      const char* const child = node.data() + kNodeHead + count * records_.size + k * pointer_bytes(level);
      take(number_at<std::uint64_t>(child), hdf5_number(child + 8, count_bytes_), level - 1);
    }
  }

  const Hdf5File& file_;
  std::size_t node_bytes_{0}, count_bytes_{1};
  std::vector<std::size_t> all_bytes_;
  std::set<std::uint64_t> seen_;
  Hdf5Records records_;
};

/// A heap of objects of any length ("fractal heap"). Its blocks grow: `width` blocks of the first size, again as many, then
/// as many of twice the size, and so on.
class LinkHeap {
 public:
  LinkHeap(const Hdf5File& file, std::uint64_t header) : file_(file) {
    const std::string head = file.read(header, 142);
    if (!head.starts_with("FRHP")) file.fail(header, "found no heap of links");
    if (number_at<std::uint16_t>(head.data() + 7) != 0)
      file.fail(header, "found a heap of links that is compressed");
    width_ = number_at<std::uint16_t>(head.data() + 110);
    first_ = number_at<std::uint64_t>(head.data() + 112);
    largest_ = number_at<std::uint64_t>(head.data() + 120);
    offset_bytes_ = (number_at<std::uint16_t>(head.data() + 128) + 7U) / 8;
    root_ = number_at<std::uint64_t>(head.data() + 132);
    rows_ = number_at<std::uint16_t>(head.data() + 140);
    constexpr std::uint64_t kLargestBlock = std::uint64_t{1} << 32;
    if (offset_bytes_ == 0 || offset_bytes_ > 8 || width_ == 0 || first_ == 0 || largest_ < first_ ||
        largest_ > kLargestBlock || rows_ > 64)
      file.fail(header, "found a heap of links that cannot be");
  }

  /// Where an object is, and its length. @param id  as a tree of names has it
  std::pair<std::uint64_t, std::uint64_t> find(std::string_view id, std::uint64_t from) const {
    if (id.size() < 2 + offset_bytes_ || (id[0] & 0x30) != 0)
      file_.fail(from, "found a link that is kept outside its heap");
    const std::uint64_t offset = hdf5_number(id.data() + 1, offset_bytes_);
    return {address_of(offset, from), hdf5_number(id.data() + 1 + offset_bytes_,
                                                  std::min<std::size_t>(8, id.size() - 1 - offset_bytes_))};
  }

 private:
  std::uint64_t address_of(std::uint64_t offset, std::uint64_t from) const {
    if (rows_ == 0) {
      if (offset >= first_) file_.fail(from, "found a link behind its heap");
      return root_ + offset;
    }
    std::uint64_t begin = 0, size = first_;
    for (std::size_t row = 0; row < rows_ && size <= largest_; ++row) {
      if (row > 1) size *= 2;
      if (size > largest_) break;
      if (offset - begin < size * width_) {
        const std::uint64_t number = row * width_ + (offset - begin) / size;
        const std::uint64_t entry = root_ + 5 + 8 + offset_bytes_ + 8 * number;
        return number_at<std::uint64_t>(file_.read(entry, 8).data()) + (offset - begin) % size;
      }
      begin += size * width_;
    }
    file_.fail(from, "found a link behind the blocks of its heap");
  }

  const Hdf5File& file_;
  std::size_t width_{0}, offset_bytes_{0}, rows_{0};
  std::uint64_t first_{0}, largest_{0}, root_{0};
};

}  // namespace

Hdf5Records records_of_tree(const Hdf5File& file, std::uint64_t header) {
  return RecordTree(file, header).records();
}

/// A link: how long its parts are is in its flags. Links by name, into this file or others, are passed over.
void Hdf5File::add_link(std::uint64_t at, std::string_view link, Objects& to) const {
  if (link.size() < 2 || link[0] != 1)
    fail(at, "found a link of {} bytes, or of a version unknown", link.size());
  const int flags = link[1];
  std::size_t used = 2;
  const bool has_kind = (flags & 8) != 0;
  const int kind = has_kind && link.size() > used ? link[used] : 0;
  used += (has_kind ? 1U : 0U) + ((flags & 4) != 0 ? 8U : 0U) + ((flags & 16) != 0 ? 1U : 0U);
  const std::size_t length_bytes = std::size_t{1} << (flags & 3);
  if (link.size() < used + length_bytes) fail(at, "found a link of {} bytes", link.size());
  const std::uint64_t length = hdf5_number(link.data() + used, length_bytes);
  used += length_bytes;
  if (kind != 0) return;
  if (length > link.size() || link.size() - length < used + 8)
    fail(at, "found a name of {} bytes in a link of {}", length, link.size());
  if (to.size() >= kMostHdf5Objects) return;
  to.emplace_back(std::string(link.substr(used, length)),
                  number_at<std::uint64_t>(link.data() + used + length));
}

void Hdf5File::add_heap_of_links(const Hdf5Message& info, Objects& to) const {
  const std::string& content = info.content;
  const std::size_t begin = content.size() > 1 && (content[1] & 1) != 0 ? 10 : 2;
  if (content.size() < begin + 16) fail(info.at, "found what is said of links in {} bytes", content.size());
  const std::uint64_t heap_at = number_at<std::uint64_t>(content.data() + begin),
                      tree_at = number_at<std::uint64_t>(content.data() + begin + 8);
  if (heap_at == kHdf5Nowhere || tree_at == kHdf5Nowhere) return;
  constexpr std::uint64_t kLongestLink = 4096;
  constexpr std::size_t kHash = 4;  // of the name, in front of the place in the heap
  const LinkHeap heap(*this, heap_at);
  const Hdf5Records records = records_of_tree(*this, tree_at);
  if (records.count() > 0 && records.size <= kHash) fail(tree_at, "found records of {} bytes", records.size);
  for (std::size_t k = 0; k < std::min(records.count(), kMostHdf5Objects); ++k) {
    const std::string_view id =
        std::string_view(records.bytes).substr(k * records.size + kHash, records.size - kHash);
    const auto [at, length] = heap.find(id, tree_at);
    if (length > kLongestLink) fail(at, "found a link of {} bytes", length);
    add_link(at, read(at, length), to);
  }
}

}  // namespace heft::data
