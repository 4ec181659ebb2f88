#include "heft/host/file_plan.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "output_place.hpp"

namespace heft::host {
namespace {

std::string identity_of(const struct stat& status) {
  return fmt::format("{}:{}", status.st_dev, status.st_ino);
}

/// Regular files, pipes, sockets, disks and folders. Others (/dev/null, a terminal) keep nothing that could be lost.
bool can_clash(const struct stat& status) { return !S_ISCHR(status.st_mode); }

/// A descriptor of this process that is a device: two outputs would still be mixed in it.
std::string identity_of(int descriptor, const struct stat& status) {
  return can_clash(status) ? identity_of(status) : fmt::format("descriptor {}", descriptor);
}

/// Empty for a file that does not exist: its reader says so.
std::string input_identity(const std::string& path) {
  struct stat status {};
  const std::optional<int> descriptor = path == "-" ? STDIN_FILENO : named_descriptor(path);
  if (descriptor) return ::fstat(*descriptor, &status) == 0 ? identity_of(*descriptor, status) : "";
  if (::stat(path.c_str(), &status) != 0 || !can_clash(status)) return {};
  return identity_of(status);
}

std::string output_identity(const OutputPlace& place) {
  if (place.descriptor) return place.exists ? identity_of(*place.descriptor, place.status) : "";
  if (place.exists) return can_clash(place.status) ? identity_of(place.status) : "";
  struct stat folder {};
  if (::stat(place.folder.c_str(), &folder) != 0) return {};
  return fmt::format("{}/{}", identity_of(folder), place.name);
}

[[noreturn]] void refuse(const std::string& path, const std::string& option, const std::string& found,
                         const std::string& remedy) {
  throw InputError(fmt::format("{}: cannot write ({}): {}; {}", path, option, found, remedy));
}

/// Makes a file there, writes to it and removes it. @return why that fails; 0 when it does not
int try_writing(const std::string& folder) {
  const Descriptor descriptor(::open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!descriptor) return errno;
  const ScratchFile scratch(descriptor.get());
  if (scratch.error() != 0) return scratch.error();
  // Some bytes: a full disk may still have room for a name.
  const std::array<char, 4096> block{};
  return write_all(scratch.descriptor(), {block.data(), block.size()});
}

void refuse_folder(const std::string& path, const std::string& option, const std::string& folder,
                   int reason) {
  const std::string where = folder == "." ? "the working folder" : fmt::format("folder {}", folder);
  switch (reason) {
    case 0: return;
    case ENOENT:
      refuse(path, option, fmt::format("there is no {}", where), "make the folder or name another one");
    case ENOTDIR:
      refuse(path, option, fmt::format("{} is a file, not a folder", folder), "name a file in a folder");
    case EACCES:
    case EPERM:
    case EROFS:
      refuse(path, option, fmt::format("{} is not writable ({})", where, std::strerror(reason)),
             "choose a folder that you may write to");
    case EFBIG:
      refuse(path, option, std::strerror(reason), "raise the limit on the size of files (ulimit -f)");
    case ENOSPC:
    case EDQUOT:
      refuse(path, option, fmt::format("no space in {} ({})", where, std::strerror(reason)),
             "free some space or choose another folder");
    default: refuse(path, option, std::strerror(reason), "choose another name or folder");
  }
}

/// Whether `folder` is one that the program makes, or lies in it.
bool is_planned(const std::string& folder, const std::vector<std::string>& planned) {
  const auto plain = [](const std::string& path) {
    return (std::filesystem::path(path) / "").lexically_normal().string();
  };
  return std::any_of(planned.begin(), planned.end(),
                     [&](const std::string& made) { return plain(folder).starts_with(plain(made)); });
}

void check_file(const std::string& path, const std::string& option, const OutputPlace& place,
                const std::vector<std::string>& planned_folders) {
  if (place.descriptor) {
    const int flags = ::fcntl(*place.descriptor, F_GETFL);
    if (flags < 0 || (flags & O_ACCMODE) == O_RDONLY) {
      refuse(path, option, "it is not open for writing", "send it somewhere, as with > FILE");
    }
    return;
  }
  if (place.exists && !S_ISREG(place.status.st_mode)) {
    if (::access(place.target.c_str(), W_OK) != 0) {
      refuse(path, option, std::strerror(errno), "choose another name");
    }
    return;
  }
  if (place.is_protected()) {
    refuse(path, option, "the file is write-protected", "choose another name, or allow it with chmod u+w");
  }
  struct stat folder {};
  const uid_t user = ::geteuid();
  if (place.exists && user != 0 && ::stat(place.folder.c_str(), &folder) == 0 &&
      (folder.st_mode & S_ISVTX) != 0 && folder.st_uid != user && place.status.st_uid != user) {
    refuse(path, option, "the file belongs to somebody else, and its folder lets only owners replace files",
           "choose another name");
  }
  const int reason = try_writing(place.folder);
  if (reason == ENOENT && is_planned(place.folder, planned_folders)) return;
  refuse_folder(path, option, place.folder, reason);
  if (place.exists) return;
  // A name that the file system does not take.
  struct stat ignored {};
  if (::lstat(place.target.c_str(), &ignored) != 0 && errno != ENOENT) {
    refuse(path, option, std::strerror(errno), "choose a shorter name");
  }
}

void check_folder(const std::string& path, const std::string& option) {
  // The innermost folder that is there has to take the rest.
  std::string folder = path;
  for (;;) {
    struct stat status {};
    if (::stat(folder.c_str(), &status) == 0) {
      if (!S_ISDIR(status.st_mode)) {
        throw InputError(
            fmt::format("{}: found a file of this name ({}), expected a folder that can be made or written "
                        "to; give another one with {}",
                        folder, option, option));
      }
      return refuse_folder(path, option, folder, try_writing(folder));
    }
    if (errno != ENOENT && errno != ENOTDIR) return refuse_folder(path, option, folder, errno);
    while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
    const std::size_t slash = folder.rfind('/');
    folder = slash == std::string::npos ? "." : slash == 0 ? "/" : folder.substr(0, slash);
  }
}

/// Whether two files hold the same bytes; reads no further than where they differ.
bool same_content(const std::string& a, const std::string& b) {
  const InputFile first = open_input(a), second = open_input(b);
  if (!first || !second) return false;
  std::array<char, 1 << 16> one{}, other{};
  for (;;) {
    const std::size_t count = std::fread(one.data(), 1, one.size(), first.get());
    if (std::fread(other.data(), 1, other.size(), second.get()) != count) return false;
    if (std::memcmp(one.data(), other.data(), count) != 0) return false;
    if (count < one.size()) return true;
  }
}

/// Length of a regular file that holds something; below 0 for all else.
off_t length_of(const std::string& path) {
  struct stat status {};
  const bool is_file = ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
  return is_file && status.st_size > 0 ? status.st_size : -1;
}

std::string repeated_in_words(const std::string& a, const std::string& b) {
  if (a == b) {
    return fmt::format(
        "given to {} twice: expected every log once, since the same samples twice are no more evidence; "
        "leave one out",
        a);
  }
  return fmt::format(
      "given to {} and to {}: a model is not judged on the log it was fitted to; expected a log that the "
      "fit has not seen; leave one out or record another",
      a, b);
}

}  // namespace

void FilePlan::add_input(const std::string& option, const std::string& path) {
  inputs_.push_back({Use::kInput, option, path, input_identity(path)});
}

void FilePlan::add_measurements(const std::string& option, const std::string& path) {
  inputs_.push_back({Use::kMeasurements, option, path, input_identity(path)});
}

void FilePlan::add_output(const std::string& option, const std::string& path) {
  outputs_.push_back({Use::kOutput, option, path, {}});
}

void FilePlan::add_output_folder(const std::string& option, const std::string& path) {
  outputs_.push_back({Use::kFolder, option, path, {}});
}

void FilePlan::check() const {
  std::vector<std::string> folders;
  for (const Entry& output : outputs_) {
    if (output.use != Use::kFolder) continue;
    check_folder(output.path, output.option);
    folders.push_back(output.path);
  }
  std::vector<Entry> seen;
  for (Entry output : outputs_) {
    if (output.use == Use::kFolder) continue;
    OutputPlace place;
    try {
      place = output_place(output.path);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{} ({})", error.what(), output.option));
    }
    output.identity = output_identity(place);
    const auto clashes = [&](const Entry& other) {
      return !output.identity.empty() && other.identity == output.identity;
    };
    for (const Entry& input : inputs_) {
      if (!clashes(input)) continue;
      throw InputError(
          fmt::format("{}: {} is the same file as {} of {}: writing it would destroy what the result is "
                      "computed from; give another name to {}",
                      output.path, output.option, input.path, input.option, output.option));
    }
    for (const Entry& other : seen) {
      if (!clashes(other)) continue;
      throw InputError(
          fmt::format("{}: {} and {} lead to the same place; expected a file of its own for each; give "
                      "another name to one of them",
                      output.path, other.option, output.option));
    }
    check_file(output.path, output.option, place, folders);
    seen.push_back(output);
  }
  refuse_repeated_measurements();
}

void FilePlan::refuse_repeated_measurements() const {
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const Entry &first = inputs_[k], &second = inputs_[i];
      if (first.use != Use::kMeasurements || second.use != Use::kMeasurements) continue;
      if (!first.identity.empty() && first.identity == second.identity) {
        throw InputError(fmt::format("{}: {}", second.path, repeated_in_words(first.option, second.option)));
      }
      const off_t length = length_of(first.path);
      if (length > 0 && length == length_of(second.path) && same_content(first.path, second.path)) {
        throw InputError(fmt::format("{}: a copy of {}, the same samples byte for byte, {}", second.path,
                                     first.path, repeated_in_words(first.option, second.option)));
      }
    }
  }
}

void FilePlan::spool_pipes() const {
  for (const Entry& entry : inputs_)
    spool_input(entry.path, entry.use == Use::kMeasurements ? "log" : "file");
}

}  // namespace heft::host
