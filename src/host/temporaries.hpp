/// @file
/// Files and folders that must not outlive a process that a signal ends. A fixed table, so that a signal handler can
/// walk it without memory or locks.
#pragma once

#include <string>

namespace heft::host {

/// A name in the table for as long as the object lives.
class Temporary {
 public:
  enum class Kind { kFile, kFolder };
  /// @param folder  descriptor of the folder that holds it; has to stay open as long as this object lives
  /// @param name    in that folder. A name too long for the table is not entered, and then stays after a signal.
  Temporary(Kind kind, int folder, const std::string& name);
  ~Temporary();
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

 private:
  int slot_;  ///< below 0: not entered
};

}  // namespace heft::host
