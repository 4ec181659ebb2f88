/// @file
/// A log that is still being written: rows from a pipe as they arrive.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::data {

/// One row of a log. SI units.
struct LiveRow {
  double time{0.0};     ///< [s]; not beyond that of the row before: the recorder's clock was set
  Eigen::VectorXd q;    ///< joint positions, n [rad, m]
  Eigen::VectorXd qd;   ///< velocities, n; size 0 where the log has none
  Eigen::VectorXd tau;  ///< torques, n [N·m, N]; size 0 where they were not asked for
};

/// Sample period of a stream: the median over its first rows, two at least [s].
/// @throws DataError above 1 s: no filter follows an arm at that rate, and time in milliseconds looks like it
double live_period(const std::vector<LiveRow>& first);

/// Reads rows as they arrive, each as soon as its line is complete. A row that cannot be used (fields missing, not a
/// number, time that goes back) is refused with a note that names its line, and reading goes on behind it: one row must
/// not end a recording. Columns that are not asked for are not looked at.
class LiveLog {
 public:
  /// Waits for the header and checks it.
  /// @param path   as of read_log(); `-` is standard input
  /// @param needs  min_samples is not used
  /// @param tell   gets one line for each row refused; after kMostNotes only their number, at the end
  /// @throws DataError as read_log() for a header that is not that of a log
  LiveLog(const std::string& path, const LogRequirements& needs,
          std::function<void(const std::string&)> tell);
  ~LiveLog();

  /// A recorder that writes nothing but rows that are refused must not flood a terminal.
  static constexpr long kMostNotes = 20;

  /// Waits for the next row that can be used.
  /// @return false at the end
  /// @throws DataError when reading fails, or for a line longer than any log has
  bool next(LiveRow& row);
  long refused() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::data
