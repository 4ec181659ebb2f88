#include "temporaries.hpp"

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <unistd.h>

#include "heft/host/signals.hpp"

namespace heft::host {
namespace {

enum State : int { kFree, kBeingSet, kFile, kFolder };

struct Slot {
  std::atomic<int> state{kFree};
  int folder{-1};
  std::array<char, 256> name{};  // the longest name that a file system takes
};

std::array<Slot, 64> table;
static_assert(std::atomic<int>::is_always_lock_free, "the signal handler must not wait");

/// Removes what the table holds, files first, then folders, the innermost (made last) first. Calls only what a signal
/// handler may call. A folder that is not empty stays.
void remove_all() {
  for (Slot& slot : table) {
    if (slot.state.load() == kFile) ::unlinkat(slot.folder, slot.name.data(), 0);
  }
  for (std::size_t k = table.size(); k-- > 0;) {
    if (table[k].state.load() == kFolder) ::unlinkat(table[k].folder, table[k].name.data(), AT_REMOVEDIR);
  }
}

extern "C" void heft_remove_and_end(int number) {
  const int saved = errno;
  remove_all();
  errno = saved;
  // Ends as it would have ended without this handler, so that a shell sees the signal.
  std::signal(number, SIG_DFL);
  std::raise(number);
}

}  // namespace

Temporary::Temporary(Kind kind, int folder, const std::string& name) : slot_(-1) {
  if (name.size() >= table.front().name.size()) return;
  for (std::size_t k = 0; k < table.size(); ++k) {
    int expected = kFree;
    if (!table[k].state.compare_exchange_strong(expected, kBeingSet)) continue;
    table[k].folder = folder;
    std::memcpy(table[k].name.data(), name.c_str(), name.size() + 1);
    table[k].state.store(kind == Kind::kFile ? kFile : kFolder);
    slot_ = static_cast<int>(k);
    return;
  }
}

Temporary::~Temporary() {
  if (slot_ >= 0) table[static_cast<std::size_t>(slot_)].state.store(kFree);
}

void remove_temporaries_on_signals() {
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGXCPU}) {
    struct sigaction present {};
    // What the caller ignores (nohup) stays ignored.
    if (::sigaction(number, nullptr, &present) != 0 || present.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = heft_remove_and_end;
    ::sigemptyset(&action.sa_mask);
    ::sigaction(number, &action, nullptr);
  }
}

}  // namespace heft::host
