#include "hdf5_file.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace heft::data {
namespace {

/// Nodes of the tree of a group, blocks of an object's header, messages in it: more than any log has.
constexpr std::size_t kMostNodes = 2000, kMostBlocks = 16, kMostMessages = 4096;
constexpr std::uint64_t kLongestBlock = std::uint64_t{1} << 17;

}  // namespace

void Hdf5File::find_root() {
  std::array<char, 8> found{};
  while (file_->read_some(base_, found.data(), found.size()) == found.size() &&
         std::string_view(found.data(), found.size()) != kHdf5Signature) {
    base_ = base_ == 0 ? 512 : 2 * base_;
  }
  const std::string block = read(0, 24);
  const int version = block[8];
  if (version > 1) {
    file_->fail(base_ + 8,
                "found version {} of the head of HDF5; expected 0 or 1; save it with 'save -v7.3', or h5py's "
                "libver='earliest'",
                version);
  }
  if (block[13] != 8 || block[14] != 8) fail(13, "found addresses of {} bytes; expected 8", int{block[13]});
  // Version 1 has four bytes more; then come four addresses, and the root's entry: name, header.
  const std::uint64_t entry = 24 + (version == 1 ? 4 : 0) + 32;
  root_ = number_at<std::uint64_t>(read(entry, 40).data() + 8);
}

std::vector<Hdf5Message> Hdf5File::messages_of(std::uint64_t header) const {
  constexpr std::size_t kHead = 16, kMessageHead = 8;
  const std::string head = read(header, kHead);
  if (head[0] != 1) {
    fail(header, "found an object's header of version {}; expected 1, which MATLAB and h5py write",
         int{head[0]});
  }
  std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks{
      {header + kHead, number_at<std::uint32_t>(head.data() + 8)}};
  std::vector<Hdf5Message> messages;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto [at, length] = blocks[b];
    if (length > kLongestBlock || blocks.size() > kMostBlocks) fail(at, "found a header of {} bytes", length);
    const std::string block = read(at, length);
    for (std::size_t used = 0; block.size() - used >= kMessageHead;) {
      Hdf5Message message;
      message.kind = number_at<std::uint16_t>(block.data() + used);
      const std::size_t count = number_at<std::uint16_t>(block.data() + used + 2);
      message.shared = (block[used + 4] & 2) != 0;
      used += kMessageHead;
      if (count > block.size() - used)
        fail(at + used, "found a message of {} bytes in the {} left", count, block.size() - used);
      message.at = at + used;
      message.content = block.substr(used, count);
      used += count;
      if (message.kind == kHdf5Continuation && count >= 16) {
        blocks.emplace_back(number_at<std::uint64_t>(message.content.data()),
                            number_at<std::uint64_t>(message.content.data() + 8));
      }
      if (message.kind != 0) messages.push_back(std::move(message));
      if (messages.size() > kMostMessages)
        fail(at, "found more than {} messages of an object", kMostMessages);
    }
  }
  return messages;
}

std::string Hdf5File::name_at(std::uint64_t heap, std::uint64_t offset) const {
  constexpr std::uint64_t kLongestName = 256;
  const std::string head = read(heap, 32);
  if (!head.starts_with("HEAP")) fail(heap, "found no heap of names");
  const std::uint64_t size = number_at<std::uint64_t>(head.data() + 8),
                      at = number_at<std::uint64_t>(head.data() + 24);
  if (offset >= size || at > bytes().size()) fail(heap, "found a name at {} of {} bytes", offset, size);
  const std::string text = read(at + offset, std::min(kLongestName, size - offset));
  return text.substr(0, text.find('\0'));
}

std::vector<std::pair<std::string, std::uint64_t>> Hdf5File::objects_in(const Hdf5Message& table) const {
  constexpr std::size_t kNode = 24, kEntry = 40;
  if (table.content.size() < 16) fail(table.at, "found a table of symbols of {} bytes", table.content.size());
  const std::uint64_t heap = number_at<std::uint64_t>(table.content.data() + 8);
  std::vector<std::pair<std::string, std::uint64_t>> objects;
  std::vector<std::uint64_t> nodes{number_at<std::uint64_t>(table.content.data())};
  std::set<std::uint64_t> seen;
  while (!nodes.empty()) {
    const std::uint64_t at = nodes.back();
    nodes.pop_back();
    if (!seen.insert(at).second || seen.size() > kMostNodes)
      fail(at, "found a tree of names that runs in circles");
    const std::string head = read(at, 8);
    const std::size_t count = number_at<std::uint16_t>(head.data() + 6);
    if (head.starts_with("TREE") && head[4] == 0) {
      const std::string keys = read(at + kNode, count * 16 + 8);
      for (std::size_t i = 0; i < count; ++i)
        nodes.push_back(number_at<std::uint64_t>(keys.data() + 16 * i + 8));
    } else if (head.starts_with("SNOD")) {
      const std::string entries = read(at + 8, count * kEntry);
      for (std::size_t i = 0; i < count && objects.size() < kMostHdf5Objects; ++i) {
        const char* const entry = entries.data() + i * kEntry;
        constexpr std::uint32_t kSoftLink = 2;
        if (number_at<std::uint32_t>(entry + 16) == kSoftLink) continue;
        objects.emplace_back(name_at(heap, number_at<std::uint64_t>(entry)),
                             number_at<std::uint64_t>(entry + 8));
      }
    } else {
      fail(at, "found no node of a tree of names");
    }
  }
  std::sort(objects.begin(), objects.end());
  return objects;
}

/// Every chunk of a data set. @throws DataError where the tree does not hold together
std::vector<Hdf5Chunk> Hdf5File::chunks_of(const Hdf5Set& set) const {
  constexpr std::size_t kNode = 24;
  const std::size_t axes = set.shape.size(), key = 8 + 8 * (axes + 1);
  std::vector<Hdf5Chunk> chunks;
  std::vector<std::uint64_t> nodes;
  if (set.at != kHdf5Nowhere) nodes.push_back(set.at);
  std::set<std::uint64_t> seen;
  while (!nodes.empty()) {
    const std::uint64_t at = nodes.back();
    nodes.pop_back();
    if (!seen.insert(at).second) fail(at, "found a tree of chunks that runs in circles");
    const std::string head = read(at, kNode);
    if (!head.starts_with("TREE") || head[4] != 1) fail(at, "found no node of a tree of chunks");
    const std::size_t count = number_at<std::uint16_t>(head.data() + 6);
    const std::string entries = read(at + kNode, count * (key + 8));
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
      if (chunks.size() > bytes().size() / key) fail(at, "found more chunks than the file has bytes for");
      for (std::size_t a = 0; a < axes; ++a)
        chunk.begin.push_back(number_at<std::uint64_t>(entry + 8 + 8 * a));
      chunks.push_back(std::move(chunk));
    }
  }
  return chunks;
}

}  // namespace heft::data
