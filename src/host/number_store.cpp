#include "heft/host/number_store.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>

#include <unistd.h>

namespace heft::host {
namespace {

/// Numbers that all stores together keep in memory: 1 MB, what a log of some seconds takes. A file costs little more, as the
/// system keeps it in memory while there is room.
constexpr std::size_t kMostInMemory = std::size_t{1} << 17U;

std::atomic<std::size_t>& in_memory() {
  static std::atomic<std::size_t> numbers{0};
  return numbers;
}

}  // namespace

NumberStore::~NumberStore() { in_memory() -= memory_.size(); }

bool NumberStore::append(std::span<const double> numbers) {
  if (!usable_) return false;
  if (!file_) {
    if (in_memory() + numbers.size() <= kMostInMemory) {
      in_memory() += numbers.size();
      memory_.insert(memory_.end(), numbers.begin(), numbers.end());
      size_ += numbers.size();
      return true;
    }
    usable_ = to_file();
  }
  usable_ = usable_ && write(numbers);
  if (usable_) size_ += numbers.size();
  return usable_;
}

bool NumberStore::to_file() {
  file_ = temporary_file();
  if (!file_ || !write(memory_)) return false;
  in_memory() -= memory_.size();
  memory_ = {};
  return true;
}

/// At the end of the file.
bool NumberStore::write(std::span<const double> numbers) {
  const char* from = reinterpret_cast<const char*>(numbers.data());
  for (std::size_t left = numbers.size_bytes(); left > 0;) {
    const ssize_t count = ::write(::fileno(file_.get()), from, left);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    from += count;
    left -= static_cast<std::size_t>(count);
  }
  return true;
}

bool NumberStore::read(std::size_t at, std::span<double> numbers) const {
  if (!usable_ || at + numbers.size() > size_) return false;
  if (!file_) {
    std::copy_n(memory_.begin() + static_cast<std::ptrdiff_t>(at), numbers.size(), numbers.begin());
    return true;
  }
  char* to = reinterpret_cast<char*>(numbers.data());
  auto offset = static_cast<off_t>(at * sizeof(double));
  for (std::size_t left = numbers.size_bytes(); left > 0;) {
    const ssize_t count = ::pread(::fileno(file_.get()), to, left, offset);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    to += count;
    offset += count;
    left -= static_cast<std::size_t>(count);
  }
  return true;
}

}  // namespace heft::host
