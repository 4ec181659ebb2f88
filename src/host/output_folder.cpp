#include "heft/host/output_folder.hpp"

#include <cerrno>
#include <cstring>
#include <list>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "temporaries.hpp"

namespace heft::host {

/// The folders that were made, outermost first. One is entered before it is made: a signal in between would leave it.
struct OutputFolder::Made {
  struct Entry {
    int parent;
    std::string name;
    Temporary temporary;
    bool made{false};

    Entry(int folder, const std::string& to_make)
        : parent(folder), name(to_make), temporary(Temporary::Kind::kFolder, folder, to_make) {}
    ~Entry() {
      if (made) ::unlinkat(parent, name.c_str(), AT_REMOVEDIR);  // stays when it holds something
      ::close(parent);
    }
    Entry(const Entry&) = delete;
    Entry& operator=(const Entry&) = delete;
  };
  std::list<Entry> entries;

  ~Made() {
    while (!entries.empty()) entries.pop_back();
  }
};

OutputFolder::OutputFolder(const std::string& path) : path_(path), made_(std::make_unique<Made>()) {
  const auto refuse = [&](const std::string& found) {
    throw InputError(fmt::format(
        "{}: found {}, expected a folder that can be made or written to; give another one with -o", path,
        found));
  };
  if (path.empty()) refuse("no name");
  std::filesystem::path so_far;
  for (const std::filesystem::path& part : path_) {
    const std::filesystem::path parent = so_far.empty() ? std::filesystem::path(".") : so_far;
    so_far /= part;
    if (part.empty() || part == "/") continue;
    struct stat status {};
    if (::stat(so_far.c_str(), &status) == 0) {
      if (!S_ISDIR(status.st_mode)) refuse("a file of this name");
      continue;
    }
    const int folder = ::open(parent.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) refuse(std::strerror(errno));
    Made::Entry& entry = made_->entries.emplace_back(folder, part.string());
    if (::mkdirat(folder, part.c_str(), 0777) == 0) {
      entry.made = true;
      continue;
    }
    const int reason = errno;
    made_->entries.pop_back();
    if (reason != EEXIST || ::stat(so_far.c_str(), &status) != 0 || !S_ISDIR(status.st_mode)) {
      refuse(std::strerror(reason));
    }
  }
  if (::access(path_.c_str(), W_OK | X_OK) != 0) refuse(std::strerror(errno));
}

OutputFolder::~OutputFolder() = default;
OutputFolder::OutputFolder(OutputFolder&&) noexcept = default;
OutputFolder& OutputFolder::operator=(OutputFolder&&) noexcept = default;

}  // namespace heft::host
