#include "heft/host/file.hpp"

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <climits>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "heft/host/file_writer.hpp"
#include "output_place.hpp"
#include "temporaries.hpp"

namespace heft::host {
namespace {

constexpr int kMostLinks = 40;  // as the kernel follows

[[noreturn]] void refuse(const std::string& path, const std::string& found, const std::string& remedy) {
  throw InputError(fmt::format("{}: cannot write: {}; {}", path, found, remedy));
}

std::string remedy_for(int reason) {
  switch (reason) {
    case ENOSPC:
    case EDQUOT: return "free some space or choose another folder";
    case EFBIG: return "raise the limit on the size of files (ulimit -f)";
    case ENAMETOOLONG: return "choose a shorter name";
    default: return "check that the folder exists and is writable";
  }
}

[[noreturn]] void refuse(const std::string& path, int reason) {
  refuse(path, std::strerror(reason), remedy_for(reason));
}

void write_to_descriptor(const std::string& path, int descriptor, std::string_view content) {
  if (descriptor == STDOUT_FILENO) {
    // Through the stream, behind what is in its buffer already.
    if (std::fwrite(content.data(), 1, content.size(), stdout) == content.size() && std::fflush(stdout) == 0)
      return;
    const int reason = errno;
    // The message names what the caller knows; the end of the program does not report it a second time.
    std::clearerr(stdout);
    if (reason == EPIPE) throw ReaderLeftError("standard output: its reader left");
    refuse(
        path == "-" ? "standard output" : path, std::strerror(reason),
        reason == ENOSPC ? "free some space or write to another place" : "check where standard output goes");
  }
  if (const int reason = write_all(descriptor, content); reason != 0) refuse(path, reason);
}

/// Owner first: changing it takes set-user-id bits away.
void keep_owner_and_mode(int descriptor, const struct stat& old) {
  // A member of the group may keep the group though not the owner; whoever may do neither writes as himself.
  if (::fchown(descriptor, old.st_uid, old.st_gid) != 0 &&
      ::fchown(descriptor, static_cast<uid_t>(-1), old.st_gid) != 0) {
    errno = 0;
  }
  ::fchmod(descriptor, old.st_mode & 07777);
}

}  // namespace

int write_all(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t count = ::write(descriptor, content.data(), content.size());
    if (count < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    content.remove_prefix(static_cast<std::size_t>(count));
  }
  return 0;
}

ScratchFile::ScratchFile(int folder) : folder_(folder) {
  static std::atomic<unsigned> number{0};
  // Short, so that it fits wherever the name of the result does. A name that is taken was left by a process that was
  // killed and had the same number.
  for (int attempt = 0; attempt < 1000; ++attempt) {
    name_ = fmt::format(".heft-{}-{}", ::getpid(), number++);
    entry_.emplace(Temporary::Kind::kFile, folder, name_);
    file_ = Descriptor(
        ::openat(folder, name_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (file_) return;
    error_ = errno;
    entry_.reset();
    if (error_ != EEXIST) return;
  }
}

ScratchFile::~ScratchFile() {
  if (file_) ::unlinkat(folder_, name_.c_str(), 0);
}

int ScratchFile::rename_to(const std::string& name) {
  // Network file systems report a full disk here.
  if (file_.close() != 0) {
    const int reason = errno;
    ::unlinkat(folder_, name_.c_str(), 0);
    return reason;
  }
  if (::renameat(folder_, name_.c_str(), folder_, name.c_str()) == 0) return 0;
  const int reason = errno;
  ::unlinkat(folder_, name_.c_str(), 0);
  return reason;
}

bool is_standard_output(std::string_view path) {
  return named_descriptor(path) == std::optional<int>(STDOUT_FILENO);
}

std::optional<int> named_descriptor(std::string_view path) {
  if (path == "-" || path == "/dev/stdout") return STDOUT_FILENO;
  if (path == "/dev/stdin") return STDIN_FILENO;
  if (path == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (path.substr(0, folder.size()) != folder) continue;
    int number = -1;
    const char* const end = path.data() + path.size();
    const auto [stop, error] = std::from_chars(path.data() + folder.size(), end, number);
    if (error == std::errc() && stop == end && number >= 0) return number;
  }
  return {};
}

std::string follow_links(std::string path) {
  for (int k = 0; k < kMostLinks; ++k) {
    if (named_descriptor(path)) return path;
    std::array<char, PATH_MAX> target{};
    const ssize_t length = ::readlink(path.c_str(), target.data(), target.size());
    if (length < 0) return path;  // no link, or nothing
    std::string next(target.data(), static_cast<std::size_t>(length));
    if (next.empty() || next.front() != '/') {
      const std::size_t slash = path.rfind('/');
      if (slash != std::string::npos) next = path.substr(0, slash + 1) + next;
    }
    path = std::move(next);
  }
  throw InputError(fmt::format("{}: links lead round in a circle; name a file", path));
}

OutputPlace output_place(const std::string& path) {
  OutputPlace place;
  const std::string target = follow_links(path);
  place.target = target;
  place.descriptor = named_descriptor(target);
  if (place.descriptor) {
    place.exists = ::fstat(*place.descriptor, &place.status) == 0;
    return place;
  }
  place.exists = ::stat(target.c_str(), &place.status) == 0;
  const int reason = place.exists ? 0 : errno;
  const std::size_t slash = target.rfind('/');
  place.folder = slash == std::string::npos ? "." : target.substr(0, slash + 1);
  place.name = slash == std::string::npos ? target : target.substr(slash + 1);
  if (reason == ENOTDIR)
    refuse(path, fmt::format("{} is a file, not a folder", place.folder), "name a file in a folder");
  if (reason != 0 && reason != ENOENT) refuse(path, reason);
  if (place.name.empty() || (place.exists && S_ISDIR(place.status.st_mode))) {
    refuse(path, "this is a folder", "name a file in it");
  }
  if (place.exists && S_ISSOCK(place.status.st_mode)) refuse(path, "this is a socket", "name a file");
  return place;
}

/// Where the content goes: a descriptor of this process, what is written through, or a new file that takes the place of
/// the old one in the end.
struct FileWriter::Impl {
  explicit Impl(const std::string& name) : path(name), place(output_place(name)) {
    if (place.descriptor) return;
    if (place.exists && !S_ISREG(place.status.st_mode)) {
      through = Descriptor(::open(place.target.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC));
      if (!through) refuse(path, std::strerror(errno), "check what this name refers to");
      return;
    }
    if (place.is_protected())
      refuse(path, "the file is write-protected", "choose another name, or allow it with chmod u+w");
    folder = Descriptor(::open(place.folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (!folder) refuse(path, errno);
    scratch.emplace(folder.get());
    if (scratch->error() != 0) refuse(path, scratch->error());
    if (place.exists) keep_owner_and_mode(scratch->descriptor(), place.status);
  }

  std::string path;
  OutputPlace place;
  Descriptor through, folder;
  std::optional<ScratchFile> scratch;
};

FileWriter::FileWriter(const std::string& path) : impl_(std::make_unique<Impl>(path)) {}
FileWriter::~FileWriter() = default;

void FileWriter::write(std::string_view content) {
  Impl& my = *impl_;
  if (my.place.descriptor) return write_to_descriptor(my.path, *my.place.descriptor, content);
  if (my.through) {
    if (const int reason = write_all(my.through.get(), content); reason != 0) refuse(my.path, reason);
    return;
  }
  if (const int reason = write_all(my.scratch->descriptor(), content); reason != 0) {
    throw InputError(
        fmt::format("{}: writing failed: {}; {}", my.path, std::strerror(reason), remedy_for(reason)));
  }
}

void FileWriter::finish() {
  Impl& my = *impl_;
  if (!my.scratch) return;
  // Without it a power failure may leave an empty file under the new name.
  if (::fsync(my.scratch->descriptor()) != 0 && errno != EINVAL && errno != ENOSYS && errno != EROFS) {
    throw InputError(fmt::format("{}: writing failed: {}; check the disk", my.path, std::strerror(errno)));
  }
  if (const int reason = my.scratch->rename_to(my.place.name); reason != 0) {
    throw InputError(
        fmt::format("{}: cannot replace the file: {}; choose another name", my.path, std::strerror(reason)));
  }
  my.scratch.reset();
}

void write_file_atomically(const std::string& path, std::string_view content) {
  FileWriter file(path);
  file.write(content);
  file.finish();
}

}  // namespace heft::host
