/// @file
/// The files of a program, looked at before the work begins.
#pragma once

#include <string>
#include <vector>

namespace heft::host {

/// All files that a program is to read and to write, each with the option that named it. Declared first; check() then
/// refuses paths that would lose data or fail after the work is done.
class FilePlan {
 public:
  void add_input(const std::string& option, const std::string& path);
  /// A log or other measurements: counted twice, they would look like twice the evidence.
  void add_measurements(const std::string& option, const std::string& path);
  void add_output(const std::string& option, const std::string& path);
  void add_output_folder(const std::string& option, const std::string& path);

  /// Looks at outputs first and at no input's content before all outputs are known to be good:
  /// - no output is the same file (device and inode, links followed) as an input or another output;
  /// - every output can be written: its folder takes a file, it is no folder itself, it is not write-protected;
  /// - no measurements are given twice, as the same file or as a copy of it with the same bytes.
  /// Devices such as /dev/null may be given several times. Writes a file of a few bytes to each output's folder and
  /// removes it. Cost: a few system calls a file; files of equal length are compared until they differ.
  /// @throws InputError naming the file, the options and what to do
  void check() const;

  /// Copies inputs that cannot be read twice; see spool_input(). @throws InputError
  void spool_pipes() const;

 private:
  enum class Use { kInput, kMeasurements, kOutput, kFolder };
  struct Entry {
    Use use;
    std::string option, path;
    std::string identity;  ///< equal for the same file; empty for a device, which is never in the way
  };
  void refuse_repeated_measurements() const;

  std::vector<Entry> inputs_, outputs_;
};

}  // namespace heft::host
