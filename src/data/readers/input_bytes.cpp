#include "input_bytes.hpp"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

namespace heft::data {
namespace {

/// Bytes taken from a file at once. A matrix stored column by column has one such buffer a column.
constexpr std::size_t kStreamBlock = std::size_t{1} << 16;

/// No recording compresses better; what does fills the disk on purpose or by damage.
constexpr std::uint64_t kMostCompression = 1000;

class PlainStream final : public ByteStream {
 public:
  PlainStream(SharedBytes file, std::uint64_t at, std::uint64_t count)
      : file_(std::move(file)), at_(at), end_(at + count) {}

  void read(char* to, std::size_t count) override {
    while (count > 0) {
      if (used_ == buffer_.size()) fill(count);
      const std::size_t part = std::min(count, buffer_.size() - used_);
      std::memcpy(to, buffer_.data() + used_, part);
      used_ += part;
      to += part;
      count -= part;
    }
  }

  void skip(std::uint64_t count) override {
    const std::uint64_t part = std::min<std::uint64_t>(count, buffer_.size() - used_);
    used_ += part;
    if (count - part > end_ - at_) fail_end(count - part);
    at_ += count - part;
  }

  std::unique_ptr<ByteStream> copy() const override { return std::make_unique<PlainStream>(*this); }

 private:
  [[noreturn]] void fail_end(std::uint64_t wanted) const {
    file_->fail(at_, "found the end of the data; expected {} bytes more; the file is damaged or was cut",
                wanted);
  }
  void fill(std::size_t wanted) {
    if (at_ == end_) fail_end(wanted);
    buffer_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kStreamBlock, end_ - at_)));
    used_ = 0;
    file_->read(at_, buffer_.data(), buffer_.size());
    at_ += buffer_.size();
  }

  SharedBytes file_;
  std::uint64_t at_, end_;  ///< behind what is in the buffer; behind the part
  std::vector<char> buffer_;
  std::size_t used_{0};
};

class InflatedStream final : public ByteStream {
 public:
  InflatedStream(SharedBytes file, std::uint64_t at, std::uint64_t count, bool raw)
      : file_(std::move(file)), begin_(at), at_(at), end_(at + count), buffer_(kStreamBlock) {
    const int window = raw ? -MAX_WBITS : MAX_WBITS;
    if (inflateInit2(&state_, window) != Z_OK) {
      throw DataError(file_->path() + ": no memory to decompress it");
    }
    state_.next_in = reinterpret_cast<Bytef*>(buffer_.data());
  }
  ~InflatedStream() override { inflateEnd(&state_); }
  /// At the same place of the same data.
  InflatedStream(const InflatedStream& other)
      : file_(other.file_),
        begin_(other.begin_),
        at_(other.at_),
        end_(other.end_),
        buffer_(other.buffer_),
        ended_(other.ended_) {
    if (inflateCopy(&state_, const_cast<z_stream*>(&other.state_)) != Z_OK) {
      throw DataError(file_->path() + ": no memory to decompress it");
    }
    state_.next_in = reinterpret_cast<Bytef*>(buffer_.data()) +
                     (other.state_.next_in - reinterpret_cast<const Bytef*>(other.buffer_.data()));
  }
  InflatedStream& operator=(const InflatedStream&) = delete;

  void read(char* to, std::size_t count) override {
    constexpr std::size_t kAtOnce = std::size_t{1} << 30;
    while (count > 0) {
      const std::size_t part = std::min(count, kAtOnce);
      inflate_to(to, static_cast<unsigned>(part));
      to += part;
      count -= part;
    }
  }

  void skip(std::uint64_t count) override {
    std::vector<char> rest(static_cast<std::size_t>(std::min<std::uint64_t>(count, kStreamBlock)));
    while (count > 0) {
      const std::size_t part = static_cast<std::size_t>(std::min<std::uint64_t>(count, rest.size()));
      read(rest.data(), part);
      count -= part;
    }
  }

  std::unique_ptr<ByteStream> copy() const override { return std::make_unique<InflatedStream>(*this); }

 private:
  void inflate_to(char* to, unsigned count) {
    state_.next_out = reinterpret_cast<Bytef*>(to);
    state_.avail_out = count;
    while (state_.avail_out > 0) {
      if (state_.avail_in == 0 && at_ < end_) {
        const std::size_t part =
            static_cast<std::size_t>(std::min<std::uint64_t>(buffer_.size(), end_ - at_));
        file_->read(at_, buffer_.data(), part);
        at_ += part;
        state_.next_in = reinterpret_cast<Bytef*>(buffer_.data());
        state_.avail_in = static_cast<unsigned>(part);
      }
      const int result = ended_ ? Z_STREAM_END : inflate(&state_, Z_NO_FLUSH);
      ended_ = result == Z_STREAM_END;
      if (state_.avail_out == 0) return;
      if (ended_ || (result == Z_BUF_ERROR && at_ == end_)) {
        file_->fail(
            begin_,
            "the compressed data end {} bytes too early; expected a whole array; the file is damaged or "
            "was cut",
            state_.avail_out);
      }
      if (result != Z_OK && result != Z_BUF_ERROR) {
        file_->fail(begin_,
                    "found data that cannot be decompressed ({}); expected deflate; the file is damaged",
                    state_.msg != nullptr ? state_.msg : "no reason given");
      }
    }
  }

  SharedBytes file_;
  std::uint64_t begin_, at_, end_;
  std::vector<char> buffer_;
  z_stream state_{};
  bool ended_{false};
};

/// Whether decompressed data may be a recording: a bag of either kind.
bool begins_as_a_bag(std::string_view data) {
  return data.starts_with("\x89MCAP0\r\n") || data.starts_with(std::string_view("SQLite format 3\0", 16));
}

struct FreeZstd {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

}  // namespace

InputBytes::InputBytes(const std::string& path) : path_(path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw DataError(fmt::format("{}: is a folder; expected a log file", path));
  }
  file_ = host::open_input(path);
  if (!file_) {
    throw DataError(fmt::format("{}: cannot read the log: {}; check the path", path, std::strerror(errno)));
  }
  struct stat status {};
  if (::fstat(descriptor(), &status) == 0 && status.st_size > 0) {
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
}

InputBytes::InputBytes(host::InputFile file, const std::string& path) : path_(path), file_(std::move(file)) {
  struct stat status {};
  if (::fstat(descriptor(), &status) == 0 && status.st_size > 0) {
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
}

int InputBytes::descriptor() const { return ::fileno(file_.get()); }

std::size_t InputBytes::read_some(std::uint64_t at, void* to, std::size_t count) const {
  if (at >= size_) return 0;
  count = static_cast<std::size_t>(std::min<std::uint64_t>(count, size_ - at));
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got =
        ::pread(descriptor(), static_cast<char*>(to) + done, count - done, static_cast<off_t>(at + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw DataError(fmt::format("{}: reading stopped: {}; check the disk", path_, std::strerror(errno)));
    }
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

void InputBytes::read(std::uint64_t at, void* to, std::size_t count) const {
  if (!has(at, count) || read_some(at, to, count) != count) {
    fail(at, "found the end of the file (it has {} bytes); expected {} bytes more here; it was cut", size_,
         count);
  }
}

std::unique_ptr<ByteStream> plain_stream(SharedBytes file, std::uint64_t at, std::uint64_t count) {
  if (!file->has(at, count)) {
    file->fail(at, "found the end of the file (it has {} bytes); expected an array of {} bytes; it was cut",
               file->size(), count);
  }
  return std::make_unique<PlainStream>(std::move(file), at, count);
}

std::unique_ptr<ByteStream> inflated_stream(SharedBytes file, std::uint64_t at, std::uint64_t count,
                                            bool raw) {
  if (!file->has(at, count)) {
    file->fail(
        at, "found the end of the file (it has {} bytes); expected {} bytes of compressed data; it was cut",
        file->size(), count);
  }
  return std::make_unique<InflatedStream>(std::move(file), at, count, raw);
}

host::InputFile decompress_zstd(const InputBytes& file) {
  const std::unique_ptr<ZSTD_DStream, FreeZstd> stream(ZSTD_createDStream());
  host::InputFile to = host::temporary_file();
  if (!stream || !to) {
    throw DataError(
        fmt::format("{}: no temporary file to decompress it into; let TMPDIR name a folder that can "
                    "be written",
                    file.path()));
  }
  std::vector<char> input(ZSTD_DStreamInSize()), output(ZSTD_DStreamOutSize());
  std::uint64_t at = 0, written = 0;
  std::size_t rest = 1;  // of the frame; 0 where one ends
  while (at < file.size()) {
    ZSTD_inBuffer in{input.data(), file.read_some(at, input.data(), input.size()), 0};
    if (in.size == 0) break;
    for (;;) {
      ZSTD_outBuffer out{output.data(), output.size(), 0};
      rest = ZSTD_decompressStream(stream.get(), &out, &in);
      if (ZSTD_isError(rest) != 0) {
        file.fail(at + in.pos,
                  "found data that cannot be decompressed ({}); expected zstd; the file is damaged",
                  ZSTD_getErrorName(rest));
      }
      if (written == 0 && out.pos > 0 && !begins_as_a_bag({output.data(), out.pos})) {
        file.fail(
            0,
            "found other data than a bag in this zstd file; expected MCAP or rosbag2's SQLite; decompress "
            "it with 'zstd -d'");
      }
      written += out.pos;
      if (written / kMostCompression > file.size()) {
        file.fail(
            at,
            "the data grow more than {} times when decompressed; expected a recording; the file is damaged",
            kMostCompression);
      }
      if (std::fwrite(output.data(), 1, out.pos, to.get()) != out.pos) {
        throw DataError(
            fmt::format("{}: no space for a decompressed copy ({}); let TMPDIR name a folder with "
                        "more space",
                        file.path(), std::strerror(errno)));
      }
      if (in.pos == in.size && out.pos < out.size) break;
    }
    at += in.size;
  }
  if (std::fflush(to.get()) != 0 || rest != 0) {
    file.fail(file.size(),
              "found the end of the file inside a zstd frame; expected a whole one; the file was cut");
  }
  return to;
}

}  // namespace heft::data
