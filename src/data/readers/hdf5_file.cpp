#include "hdf5_file.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace heft::data {
namespace {

/// Nodes of the tree of a group, blocks of an object's header, messages in it: more than any log has.
constexpr std::size_t kMostNodes = 2000, kMostBlocks = 16, kMostMessages = 4096;
constexpr std::uint64_t kLongestBlock = std::uint64_t{1} << 17;

/// The blocks of an object's header, one after the other, and the messages in them.
class MessageBlocks {
 public:
  void add(std::uint64_t at, std::uint64_t length) { blocks_.emplace_back(at, length); }
  /// Goes to the next block. @return false where there is none
  bool next(const Hdf5File& file) {
    if (number_ == blocks_.size()) return false;
    const auto [at, length] = blocks_[number_++];
    if (length > kLongestBlock || blocks_.size() > kMostBlocks)
      file.fail(at, "found a header of {} bytes", length);
    at_ = at;
    used_ = 0;
    block_ = file.read(at, length);
    return true;
  }
  void strip(const Hdf5File& file, std::string_view signature, std::size_t front, std::size_t back) {
    if (block_.size() < front + back || !block_.starts_with(signature))
      file.fail(at_, "found no block of an object's header");
    used_ = front;
    block_.resize(block_.size() - back);
  }
  std::size_t left() const { return block_.size() - used_; }
  const char* data() const { return block_.data() + used_; }
  /// Takes the message whose head of `head` bytes comes next.
  void take(const Hdf5File& file, std::uint16_t kind, std::size_t count, bool shared, std::size_t head) {
    used_ += head;
    if (count > left()) file.fail(at_ + used_, "found a message of {} bytes in the {} left", count, left());
    Hdf5Message message{kind, shared, at_ + used_, block_.substr(used_, count)};
    used_ += count;
    if (kind == kHdf5Continuation && count >= 16) {
      add(number_at<std::uint64_t>(message.content.data()),
          number_at<std::uint64_t>(message.content.data() + 8));
    }
    if (kind != 0) messages.push_back(std::move(message));
    if (messages.size() > kMostMessages)
      file.fail(at_, "found more than {} messages of an object", kMostMessages);
  }

  std::vector<Hdf5Message> messages;

 private:
  std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks_;
  std::size_t number_{0}, used_{0};
  std::uint64_t at_{0};
  std::string block_;
};

}  // namespace

std::uint64_t hdf5_number(const char* at, std::size_t bytes) {
  std::uint64_t number = 0;
  for (std::size_t k = std::min<std::size_t>(bytes, 8); k-- > 0;)
    number = number << 8 | static_cast<unsigned char>(at[k]);
  return number;
}

void Hdf5File::find_root() {
  std::array<char, 8> found{};
  while (file_->read_some(base_, found.data(), found.size()) == found.size() &&
         std::string_view(found.data(), found.size()) != kHdf5Signature) {
    base_ = base_ == 0 ? 512 : 2 * base_;
  }
  const std::string block = read(0, 24);
  const int version = block[8];
  if (version < 0 || version > 3) {
    file_->fail(
        base_ + 8,
        "found version {} of the head of HDF5; expected 0 to 3; save it with 'save -v7.3', or rewrite it: h5repack "
        "--low=0 --high=0 OLD.h5 NEW.h5",
        version);
  }
  const std::size_t sizes = version < 2 ? 13 : 9;
  if (block[sizes] != 8 || block[sizes + 1] != 8)
    fail(sizes, "found addresses of {} bytes; expected 8", int{block[sizes]});
  if (version >= 2) {  // behind them flags; then come four addresses
    root_ = number_at<std::uint64_t>(read(12, 32).data() + 24);
    return;
  }
  // Version 1 has four bytes more; then come four addresses, and the root's entry: name, header.
  const std::uint64_t entry = 24 + (version == 1 ? 4 : 0) + 32;
  root_ = number_at<std::uint64_t>(read(entry, 40).data() + 8);
}

std::vector<Hdf5Message> Hdf5File::messages_of(std::uint64_t header) const {
  const std::string head = read(header, 16);
  if (head.starts_with("OHDR")) return messages_of_new(header);
  if (head[0] != 1)
    fail(header, "found no object's header, or one of version {}; expected 1 or 2", int{head[0]});
  return messages_of_old(header, head);
}

std::vector<Hdf5Message> Hdf5File::messages_of_old(std::uint64_t header, const std::string& head) const {
  MessageBlocks blocks;
  blocks.add(header + head.size(), number_at<std::uint32_t>(head.data() + 8));
  while (blocks.next(*this)) {
    constexpr std::size_t kMessageHead = 8;
    while (blocks.left() >= kMessageHead) {
      const char* const at = blocks.data();
      blocks.take(*this, number_at<std::uint16_t>(at), number_at<std::uint16_t>(at + 2), (at[4] & 2) != 0,
                  kMessageHead);
    }
  }
  return blocks.messages;
}

/// Version 2: shorter heads of messages, a signature in front of each block but the first and a checksum behind it.
std::vector<Hdf5Message> Hdf5File::messages_of_new(std::uint64_t header) const {
  constexpr std::size_t kSignature = 4, kChecksum = 4;
  const std::string head = read(header, 6);
  if (head[4] != 2) fail(header, "found an object's header of version {}; expected 1 or 2", int{head[4]});
  const int flags = head[5];
  const std::size_t length_bytes = std::size_t{1} << (flags & 3);
  const std::uint64_t length_at = header + 6 + ((flags & 0x20) != 0 ? 16 : 0) + ((flags & 0x10) != 0 ? 4 : 0);
  const std::size_t message_head = (flags & 4) != 0 ? 6 : 4;
  MessageBlocks blocks;
  blocks.add(length_at + length_bytes, hdf5_number(read(length_at, length_bytes).data(), length_bytes));
  for (bool is_first = true; blocks.next(*this); is_first = false) {
    if (!is_first) blocks.strip(*this, "OCHK", kSignature, kChecksum);
    while (blocks.left() >= message_head) {
      const char* const at = blocks.data();
      blocks.take(*this, static_cast<unsigned char>(at[0]), number_at<std::uint16_t>(at + 1),
                  (at[3] & 2) != 0, message_head);
    }
  }
  return blocks.messages;
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

bool Hdf5File::is_group(const std::vector<Hdf5Message>& messages) {
  return std::ranges::any_of(messages, [](const Hdf5Message& m) {
    return m.kind == kHdf5SymbolTable || m.kind == kHdf5LinkInfo || m.kind == kHdf5Link;
  });
}

std::vector<std::pair<std::string, std::uint64_t>> Hdf5File::objects_in(
    const std::vector<Hdf5Message>& group) const {
  Objects objects;
  for (const Hdf5Message& message : group) {
    if (message.kind == kHdf5SymbolTable) add_symbols(message, objects);
    if (message.kind == kHdf5Link) add_link(message.at, message.content, objects);
    if (message.kind == kHdf5LinkInfo) add_heap_of_links(message, objects);
  }
  std::sort(objects.begin(), objects.end());
  return objects;
}

void Hdf5File::add_symbols(const Hdf5Message& table, Objects& objects) const {
  constexpr std::size_t kNode = 24, kEntry = 40;
  if (table.content.size() < 16) fail(table.at, "found a table of symbols of {} bytes", table.content.size());
  const std::uint64_t heap = number_at<std::uint64_t>(table.content.data() + 8);
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
}

}  // namespace heft::data
