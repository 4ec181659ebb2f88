/// @file
/// MCAP: records `kind:uint8, length:uint64, content`, little endian, between two magics; messages alone or in compressed
/// chunks (https://mcap.dev/spec). Read from front to back, so that recordings without an index, and those that were cut,
/// are read too; the index is used for the list of topics only.
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include "bag.hpp"

namespace heft::data {
namespace {

constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";

/// Kinds of records.
enum McapKind : unsigned char {
  kMcapHeader = 0x01,
  kMcapFooter = 0x02,
  kMcapSchema = 0x03,
  kMcapChannel = 0x04,
  kMcapMessage = 0x05,
  kMcapChunk = 0x06,
  kMcapStatistics = 0x0B,
  kMcapDataEnd = 0x0F
};

/// Bytes before a record's content.
constexpr std::uint64_t kMcapPrefix = 9;

/// A message before its data: channel, sequence, two times.
constexpr std::uint64_t kMcapMessageHead = 22;

/// Largest chunk or message read into memory [bytes]; recorders write chunks of 1 to 4 MB.
constexpr std::uint64_t kLargestRecord = std::uint64_t{1} << 28;

/// Longest schema or channel taken [bytes]: their text is a page or two.
constexpr std::uint64_t kLongestDefinition = std::uint64_t{1} << 22;

/// Fields of a record from front to back.
class McapFields {
 public:
  McapFields(const InputBytes& file, std::uint64_t at, std::string_view content, std::string_view record)
      : file_(file), at_(at), content_(content), record_(record) {}

  template <typename T>
  T number() {
    const T value = number_at<T>(take(sizeof(T)).data());
    return value;
  }
  std::string_view text() { return take(number<std::uint32_t>()); }
  std::string_view rest() const { return content_.substr(used_); }
  std::string_view take(std::uint64_t count) {
    if (count > content_.size() - used_) {
      file_.fail(at_ + used_, "found {} bytes left in this {}; expected {}; the file is damaged",
                 content_.size() - used_, record_, count);
    }
    const std::string_view part = content_.substr(used_, static_cast<std::size_t>(count));
    used_ += part.size();
    return part;
  }

 private:
  const InputBytes& file_;
  std::uint64_t at_;
  std::string_view content_;
  std::string_view record_;
  std::size_t used_{0};
};

struct McapRecord {
  unsigned char kind{0};
  std::uint64_t at{0};      ///< of the record
  std::uint64_t length{0};  ///< of the content
  std::uint64_t content() const { return at + kMcapPrefix; }
  std::uint64_t end() const { return content() + length; }
};

struct McapChannel {
  std::uint16_t schema{0};
  std::string topic, encoding;
  std::uint64_t messages{0};
  std::int64_t first{0}, last{0};
};

struct FreeZstdContext {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};
struct FreeLz4Context {
  void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
};

class McapSource final : public MessageSource {
 public:
  explicit McapSource(SharedBytes file) : file_(std::move(file)) {
    whole_ = file_->size() >= 2 * kMcapMagic.size() && ends_with_magic();
    rewind();
  }

  const std::string& path() const override { return file_->path(); }
  std::string format() const override {
    if (compressions_.empty()) return "MCAP";
    std::string list;
    for (const std::string& each : compressions_) list += (list.empty() ? "" : ", ") + each;
    return "MCAP (" + list + ")";
  }
  std::vector<BagTopic> topics(bool counted) override;
  void choose(const std::string& topic) override {
    rewind();
    chosen_ = topic;
    choosing_ = true;
  }
  bool next(BagMessage& message) override;
  double part_read() const override {
    return ended_ ? 1.0
                  : static_cast<double>(std::min(at_, file_->size())) / static_cast<double>(file_->size());
  }
  std::vector<std::string> notes() const override;

 private:
  bool ends_with_magic() const {
    std::array<char, kMcapMagic.size()> end{};
    file_->read(file_->size() - end.size(), end.data(), end.size());
    return std::string_view(end.data(), end.size()) == kMcapMagic;
  }
  void rewind() {
    at_ = kMcapMagic.size();
    chunk_.clear();
    chunk_used_ = 0;
    ended_ = false;
  }
  bool next_record(McapRecord& record);
  bool next_in_chunk(BagMessage& message);
  bool take_message(std::string_view content, std::uint64_t at, BagMessage& message);
  void take_definition(const McapRecord& record, std::string_view content);
  void open_chunk(const McapRecord& record);
  void decompress(const McapRecord& record, std::string_view compression, std::string_view data,
                  std::uint64_t size);
  bool read_summary();
  void count_all();
  bool is_chosen(std::uint16_t channel) const {
    const auto found = channels_.find(channel);
    return found != channels_.end() && found->second.topic == chosen_;
  }

  SharedBytes file_;
  bool whole_{false};  ///< ends as a finished file does
  std::uint64_t at_{0};
  bool ended_{false};
  std::uint64_t cut_at_{0};  ///< 0: not cut
  bool choosing_{false};
  std::string chosen_;
  std::map<std::uint16_t, std::string> schemas_;
  std::map<std::uint16_t, McapChannel> channels_;
  std::set<std::string> compressions_;
  std::vector<char> record_;  ///< content of a record outside chunks, or a compressed chunk
  std::vector<char> chunk_;   ///< its records
  std::size_t chunk_used_{0};
  std::uint64_t chunk_at_{0};
  bool listed_{false};
  std::unique_ptr<ZSTD_DCtx, FreeZstdContext> zstd_;
  std::unique_ptr<LZ4F_dctx, FreeLz4Context> lz4_;
};

/// The next record outside chunks. @return false at the end, where the file was cut too
bool McapSource::next_record(McapRecord& record) {
  if (ended_) return false;
  std::array<char, kMcapPrefix> head{};
  const std::size_t got = file_->read_some(at_, head.data(), head.size());
  record.at = at_;
  record.kind = static_cast<unsigned char>(head[0]);
  record.length = number_at<std::uint64_t>(head.data() + 1);
  ended_ = true;
  if (got == 0) return false;
  if (got == head.size() && record.kind == 0) {
    file_->fail(at_, "found a record of kind 0; expected 1 to 15, or 128 and above; the file is damaged");
  }
  if (got < head.size() || !file_->has(record.content(), record.length)) {
    if (whole_) {
      file_->fail(at_,
                  "found a record of {} bytes, more than the file has; expected a shorter one, as the file "
                  "was written to its end; it is damaged",
                  record.length);
    }
    cut_at_ = at_;
    return false;
  }
  if (record.kind == kMcapDataEnd || record.kind == kMcapFooter) return false;
  at_ = record.end();
  ended_ = false;
  return true;
}

bool McapSource::next(BagMessage& message) {
  for (;;) {
    if (next_in_chunk(message)) return true;
    McapRecord record;
    if (!next_record(record)) return false;
    if (record.kind == kMcapMessage) {
      std::array<char, kMcapMessageHead> head{};
      if (record.length < head.size()) {
        file_->fail(record.at, "found a message of {} bytes; expected at least {}; the file is damaged",
                    record.length, head.size());
      }
      // Pictures are not read only to be left out.
      file_->read(record.content(), head.data(), head.size());
      if (choosing_ && !is_chosen(number_at<std::uint16_t>(head.data()))) continue;
    } else if (record.kind != kMcapSchema && record.kind != kMcapChannel && record.kind != kMcapChunk) {
      continue;
    }
    if (record.kind == kMcapChunk) {
      open_chunk(record);
      continue;
    }
    const std::uint64_t most = record.kind == kMcapMessage ? kLargestRecord : kLongestDefinition;
    if (record.length > most) {
      file_->fail(record.at, "found a record of {} bytes; expected at most {}; this cannot be read",
                  record.length, most);
    }
    record_.resize(static_cast<std::size_t>(record.length));
    file_->read(record.content(), record_.data(), record_.size());
    const std::string_view content(record_.data(), record_.size());
    if (record.kind != kMcapMessage) {
      take_definition(record, content);
    } else if (take_message(content, record.at, message)) {
      return true;
    }
  }
}

bool McapSource::next_in_chunk(BagMessage& message) {
  while (chunk_used_ < chunk_.size()) {
    const std::size_t left = chunk_.size() - chunk_used_;
    const char* const begin = chunk_.data() + chunk_used_;
    const std::uint64_t length = left < kMcapPrefix ? 0 : number_at<std::uint64_t>(begin + 1);
    if (left < kMcapPrefix || length > left - kMcapPrefix) {
      file_->fail(chunk_at_,
                  "found a record of {} bytes where the chunk has {} left; expected whole records; the "
                  "file is damaged",
                  length, left);
    }
    McapRecord record;
    record.kind = static_cast<unsigned char>(*begin);
    record.at = chunk_at_;
    record.length = length;
    chunk_used_ += static_cast<std::size_t>(kMcapPrefix + length);
    const std::string_view content(begin + kMcapPrefix, static_cast<std::size_t>(length));
    if (record.kind == kMcapSchema || record.kind == kMcapChannel) take_definition(record, content);
    if (record.kind == kMcapMessage && take_message(content, chunk_at_, message)) return true;
  }
  return false;
}

/// @return whether it is of the topic chosen
bool McapSource::take_message(std::string_view content, std::uint64_t at, BagMessage& message) {
  McapFields fields(*file_, at, content, "message");
  const std::uint16_t channel = fields.number<std::uint16_t>();
  fields.number<std::uint32_t>();  // its number among the messages of the publisher
  message.recorded = static_cast<std::int64_t>(fields.number<std::uint64_t>());
  fields.number<std::uint64_t>();  // when published
  message.data = fields.rest();
  message.at = at;
  if (!choosing_) {
    const auto found = channels_.find(channel);
    if (found == channels_.end()) {
      file_->fail(
          at,
          "found a message of channel {}, which is not described before; expected one that is; the file "
          "is damaged",
          channel);
    }
    McapChannel& known = found->second;
    if (known.messages++ == 0) known.first = message.recorded;
    known.last = message.recorded;
    return true;
  }
  return is_chosen(channel);
}

void McapSource::take_definition(const McapRecord& record, std::string_view content) {
  McapFields fields(*file_, record.content(), content, record.kind == kMcapSchema ? "schema" : "channel");
  const std::uint16_t id = fields.number<std::uint16_t>();
  if (record.kind == kMcapSchema) {
    schemas_[id] = std::string(fields.text());
    return;
  }
  McapChannel channel;
  channel.schema = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.encoding = fields.text();
  const auto before = channels_.find(id);
  if (before == channels_.end()) {
    channels_.emplace(id, std::move(channel));
  } else if (before->second.topic != channel.topic) {
    file_->fail(record.at,
                "found channel {} described as '{}' and as '{}'; expected one topic; the file is damaged", id,
                before->second.topic, channel.topic);
  }
}

void McapSource::open_chunk(const McapRecord& record) {
  // Fixed fields, then the name of the compression, which is short.
  constexpr std::size_t kMostHead = 28 + 4 + 64 + 8;
  std::array<char, kMostHead> bytes{};
  const std::size_t count = static_cast<std::size_t>(std::min<std::uint64_t>(record.length, bytes.size()));
  file_->read(record.content(), bytes.data(), count);
  McapFields head(*file_, record.content(), {bytes.data(), count}, "chunk");
  head.take(16);  // first and last time
  const std::uint64_t size = head.number<std::uint64_t>();
  const std::uint32_t checksum = head.number<std::uint32_t>();
  const std::string compression(head.text());
  const std::uint64_t stored = head.number<std::uint64_t>();
  const std::uint64_t begin = record.content() + (count - head.rest().size());
  if (stored != record.end() - begin) {
    file_->fail(begin - 8, "found {} bytes of records in a chunk that has {}; the file is damaged", stored,
                record.end() - begin);
  }
  if (size > kLargestRecord || stored > kLargestRecord) {
    file_->fail(record.at,
                "found a chunk of {} bytes; expected at most {}; write smaller chunks ('mcap compress "
                "--chunk-size')",
                std::max(size, stored), kLargestRecord);
  }
  if (!compression.empty() && compression != "lz4" && compression != "zstd") {
    file_->fail(record.at,
                "found a chunk compressed by '{}'; expected lz4, zstd or none; convert the file with 'mcap "
                "compress'",
                compression.substr(0, 40));
  }
  if (!compression.empty()) compressions_.insert(compression);
  chunk_at_ = record.at;
  chunk_used_ = 0;
  if (compression.empty()) {
    if (size != stored) {
      file_->fail(record.at, "found a chunk of {} bytes said to have {}; the file is damaged", stored, size);
    }
    chunk_.resize(static_cast<std::size_t>(size));
    file_->read(begin, chunk_.data(), chunk_.size());
  } else {
    record_.resize(static_cast<std::size_t>(stored));
    file_->read(begin, record_.data(), record_.size());
    decompress(record, compression, {record_.data(), record_.size()}, size);
  }
  const auto* const data = reinterpret_cast<const Bytef*>(chunk_.data());
  if (checksum != 0 && crc32(0L, data, static_cast<uInt>(chunk_.size())) != checksum) {
    file_->fail(record.at, "the checksum of this chunk is wrong; the file is damaged; try 'mcap recover'");
  }
}

void McapSource::decompress(const McapRecord& record, std::string_view compression, std::string_view data,
                            std::uint64_t size) {
  std::string problem;
  // Grows with what is there, so that a damaged size does not take memory.
  constexpr std::size_t kFirst = std::size_t{1} << 22;
  chunk_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(size, kFirst)));
  std::size_t written = 0, used = 0;
  bool ended = false;
  if (compression == "zstd") {
    if (!zstd_) zstd_.reset(ZSTD_createDCtx());
    ZSTD_DCtx_reset(zstd_.get(), ZSTD_reset_session_only);
  } else {
    if (!lz4_) {
      LZ4F_dctx* context = nullptr;
      if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) == 0) lz4_.reset(context);
    }
    if (lz4_) LZ4F_resetDecompressionContext(lz4_.get());
  }
  while (problem.empty() && !ended) {
    if (written == chunk_.size() && written < size) {
      chunk_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(size, 2 * written)));
    }
    const std::size_t before = written + used;
    if (compression == "zstd") {
      ZSTD_outBuffer out{chunk_.data(), chunk_.size(), written};
      ZSTD_inBuffer in{data.data(), data.size(), used};
      const std::size_t rest = ZSTD_decompressStream(zstd_.get(), &out, &in);
      if (ZSTD_isError(rest) != 0) problem = ZSTD_getErrorName(rest);
      ended = rest == 0;
      written = out.pos;
      used = in.pos;
    } else {
      std::size_t room = chunk_.size() - written, left = data.size() - used;
      const std::size_t rest =
          LZ4F_decompress(lz4_.get(), chunk_.data() + written, &room, data.data() + used, &left, nullptr);
      if (LZ4F_isError(rest) != 0) problem = LZ4F_getErrorName(rest);
      ended = rest == 0;
      written += room;
      used += left;
    }
    if (problem.empty() && !ended && written + used == before && (written == size || used == data.size()))
      break;
  }
  if (problem.empty() && (!ended || written != size)) {
    problem = fmt::format("not the {} bytes that it states", size);
  }
  if (!problem.empty()) {
    file_->fail(record.at,
                "found a chunk that cannot be decompressed ({}: {}); the file is damaged; try 'mcap "
                "recover'",
                compression, problem);
  }
  chunk_.resize(written);
}

/// Topics from the index at the end of the file. @return false where there is none, or not all is in it
bool McapSource::read_summary() {
  constexpr std::uint64_t kFooter = kMcapPrefix + 20;
  const std::uint64_t tail = kFooter + kMcapMagic.size();
  if (!whole_ || file_->size() < tail + kMcapMagic.size()) return false;
  std::array<char, kFooter> footer{};
  file_->read(file_->size() - tail, footer.data(), footer.size());
  const std::uint64_t begin = number_at<std::uint64_t>(footer.data() + kMcapPrefix);
  const std::uint64_t end = file_->size() - tail;
  if (static_cast<unsigned char>(footer[0]) != kMcapFooter || begin == 0 || begin >= end ||
      end - begin > kLargestRecord) {
    return false;
  }
  std::vector<char> summary(static_cast<std::size_t>(end - begin));
  file_->read(begin, summary.data(), summary.size());
  bool has_statistics = false;
  for (std::uint64_t at = 0; summary.size() - at >= kMcapPrefix;) {
    McapRecord record;
    record.kind = static_cast<unsigned char>(summary[at]);
    record.at = begin + at;
    record.length = number_at<std::uint64_t>(summary.data() + at + 1);
    if (record.length > summary.size() - at - kMcapPrefix) return false;
    const std::string_view content(summary.data() + at + kMcapPrefix,
                                   static_cast<std::size_t>(record.length));
    at += kMcapPrefix + record.length;
    if (record.kind == kMcapSchema || record.kind == kMcapChannel) take_definition(record, content);
    if (record.kind != kMcapStatistics) continue;
    McapFields fields(*file_, record.content(), content, "statistics");
    fields.take(8 + 2 + 4 + 4 + 4 + 4);  // messages, schemas, channels, attachments, metadata, chunks
    const std::int64_t first = static_cast<std::int64_t>(fields.number<std::uint64_t>());
    const std::int64_t last = static_cast<std::int64_t>(fields.number<std::uint64_t>());
    for (std::uint32_t left = fields.number<std::uint32_t>() / 10; left > 0; --left) {
      const std::uint16_t id = fields.number<std::uint16_t>();
      const std::uint64_t count = fields.number<std::uint64_t>();
      const auto found = channels_.find(id);
      if (found == channels_.end()) return false;
      found->second.messages = count;
      found->second.first = first;
      found->second.last = last;
    }
    has_statistics = true;
  }
  return has_statistics && !channels_.empty();
}

void McapSource::count_all() {
  channels_.clear();
  schemas_.clear();
  choosing_ = false;
  rewind();
  BagMessage message;
  while (next(message)) continue;
  rewind();
}

std::vector<BagTopic> McapSource::topics(bool) {
  if (!listed_ && !read_summary()) count_all();
  listed_ = true;
  std::map<std::string, BagTopic> by_name;
  for (const auto& [id, channel] : channels_) {
    BagTopic& topic = by_name[channel.topic];
    const auto schema = schemas_.find(channel.schema);
    const bool is_first = topic.messages == 0;
    if (topic.name.empty() || channel.messages > 0) {
      topic.type = schema == schemas_.end() ? "" : schema->second;
      topic.encoding = channel.encoding;
    }
    topic.name = channel.topic;
    if (channel.messages == 0) continue;
    topic.first = is_first ? channel.first : std::min(topic.first, channel.first);
    topic.last = is_first ? channel.last : std::max(topic.last, channel.last);
    topic.messages += channel.messages;
  }
  std::vector<BagTopic> list;
  for (auto& [name, topic] : by_name) list.push_back(std::move(topic));
  return list;
}

std::vector<std::string> McapSource::notes() const {
  if (cut_at_ == 0) return {};
  return {
      fmt::format("the file was cut; what is whole was read, up to byte {} of {}", cut_at_, file_->size())};
}

}  // namespace

bool recognises_mcap(std::string_view head) { return head.starts_with(kMcapMagic); }

std::unique_ptr<MessageSource> open_mcap(SharedBytes file) {
  return std::make_unique<McapSource>(std::move(file));
}

}  // namespace heft::data
