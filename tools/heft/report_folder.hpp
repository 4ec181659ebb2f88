/// @file
/// A folder with a report: the page, tables as CSV, figures as SVG, results as JSON.
#pragma once

#include <string>

#include "heft/host/output_folder.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"

namespace heft::tools {

/// Headers and rows with commas between; quoted where a cell needs it.
std::string to_csv(const page::Table& table);

/// Names files in the folder and writes them, each whole or not at all.
class ReportFolder {
 public:
  /// Makes the folder if it is not there.
  /// @throws InputError when it cannot be made or is a file
  explicit ReportFolder(const std::string& path);
  std::string file(const std::string& name) const { return folder_.file(name); }
  void csv(const std::string& name, const page::Table& table) const;
  /// Notes once on standard error when gnuplot is missing and no figure is written.
  void figure(const std::string& name, const page::PlotSpec& spec) const;
  void figure(const std::string& name, const page::MapSpec& spec) const;

 private:
  void warn_unless(bool written) const;

  host::OutputFolder folder_;
  mutable bool warned_{false};
};

}  // namespace heft::tools
