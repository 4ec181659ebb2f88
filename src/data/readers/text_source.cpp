#include "text_source.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "heft/host/error.hpp"

namespace heft::data {

/// A gzip file as it is unpacked; it may have several parts, one behind the other.
struct TextSource::Unpack {
  static constexpr std::size_t kBlock = std::size_t{1} << 16;

  Unpack() : packed(kBlock) {
    // 16: with the header and checksum of gzip.
    if (::inflateInit2(&stream, 15 + 16) != Z_OK) throw Error("zlib cannot be started");
  }
  ~Unpack() { ::inflateEnd(&stream); }
  Unpack(const Unpack&) = delete;
  Unpack& operator=(const Unpack&) = delete;

  z_stream stream{};
  std::vector<char> packed;
  bool part_ended{false};
  bool ended{false};
};

TextSource::TextSource(host::InputFile file, std::string path, bool live)
    : file_(std::move(file)), path_(std::move(path)), live_(live) {
  struct stat status {};
  const bool is_file = ::fstat(::fileno(file_.get()), &status) == 0 && S_ISREG(status.st_mode);
  file_size_ = is_file ? static_cast<double>(status.st_size) : 0.0;
}

TextSource::~TextSource() = default;

std::size_t TextSource::read_file(char* to, std::size_t room) {
  std::size_t count = 0;
  bool failed = false;
  if (live_) {  // fread would wait until the buffer is full
    ssize_t got = 0;
    do got = ::read(::fileno(file_.get()), to, room);
    while (got < 0 && errno == EINTR);
    failed = got < 0;
    count = failed ? 0 : static_cast<std::size_t>(got);
  } else {
    count = std::fread(to, 1, room, file_.get());
    failed = count == 0 && std::ferror(file_.get()) != 0;
  }
  if (failed)
    throw DataError(fmt::format("{}: reading stopped: {}; check the disk", path_, std::strerror(errno)));
  bytes_read_ += static_cast<double>(count);
  return count;
}

std::size_t TextSource::unpack(char* to, std::size_t room) {
  Unpack& my = *unpack_;
  my.stream.next_out = reinterpret_cast<Bytef*>(to);
  my.stream.avail_out = static_cast<uInt>(room);
  while (!my.ended && my.stream.avail_out == room) {
    if (my.stream.avail_in == 0) {
      const std::size_t count = read_file(my.packed.data(), my.packed.size());
      my.stream.next_in = reinterpret_cast<Bytef*>(my.packed.data());
      my.stream.avail_in = static_cast<uInt>(count);
      if (count == 0) {
        my.ended = true;
        if (my.part_ended) break;
        throw DataError(fmt::format(
            "{}: the gzip file ends before its data do: it was cut; copy it again, or unpack what is there "
            "(zcat) and remove the last line",
            path_));
      }
    }
    if (my.part_ended) {
      // Another part, or zeros that fill a block of a tape.
      if (*my.stream.next_in != 0x1f) {
        my.ended = true;
        break;
      }
      ::inflateReset(&my.stream);
      my.part_ended = false;
    }
    const int result = ::inflate(&my.stream, Z_NO_FLUSH);
    if (result == Z_STREAM_END) {
      my.part_ended = true;
    } else if (result != Z_OK && result != Z_BUF_ERROR) {
      throw DataError(fmt::format("{}: the gzip file is damaged ({}); copy it again", path_,
                                  my.stream.msg != nullptr ? my.stream.msg : "zlib gives no reason"));
    }
  }
  return room - my.stream.avail_out;
}

std::size_t TextSource::read(char* to, std::size_t room) {
  if (unpack_) return unpack(to, room);
  std::size_t count = read_file(to, room);
  if (looked_ || live_ || count < 2) return count;
  looked_ = true;
  if (to[0] != '\x1f' || to[1] != '\x8b') return count;
  unpack_ = std::make_unique<Unpack>();
  unpack_->packed.assign(to, to + count);
  unpack_->packed.resize(std::max(count, Unpack::kBlock));
  unpack_->stream.next_in = reinterpret_cast<Bytef*>(unpack_->packed.data());
  unpack_->stream.avail_in = static_cast<uInt>(count);
  return unpack(to, room);
}

double TextSource::part_read() const {
  return file_size_ > 0.0 ? std::min(1.0, bytes_read_ / file_size_) : 0.0;
}

}  // namespace heft::data
