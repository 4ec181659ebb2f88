/// @file
/// A log that is still being written: rows from a pipe as they arrive.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
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

/// When the rows of a stream come. The first of them give the sample period, which filters have to know before they take one; a row
/// that does not follow the one before starts anew: the recorder's clock was set.
///
/// @code
/// const std::vector<LiveRow>& rows = clock.push(row);
/// if (clock.anew()) filter.reset();
/// for (const LiveRow& each : rows) take(each, clock.period());
/// @endcode
class LiveClock {
 public:
  static constexpr std::size_t kFirstRows = 6;

  /// @param name  of the stream, for messages; may be empty
  explicit LiveClock(std::string name = "") : name_(std::move(name)) {}

  /// Takes a row.
  /// @return the rows to go through now: none until the sample period is known, then those that waited, then this one alone
  /// @throws DataError for a sample period above 1 s: no filter follows an arm at that rate, and time in milliseconds looks like it
  const std::vector<LiveRow>& push(const LiveRow& row);
  /// The stream ends. @return rows that still waited: none, or two at least
  const std::vector<LiveRow>& end();

  /// The last row was a first one: the stream began with it, or goes on by another clock (time that does not increase, or leaps by
  /// kLongestStep: a recorder that boots at zero is set to the time of day).
  bool anew() const { return anew_; }
  /// From the row before to the last one; 0 where that was a first one [s].
  double step() const { return step_; }
  /// Median over the first rows [s]. @pre rows were handed out since anew()
  double period() const { return period_; }
  /// Rows that wait for the sample period.
  std::size_t waiting() const { return first_.size(); }

 private:
  const std::vector<LiveRow>& hand_out_first();

  std::string name_;
  std::vector<LiveRow> first_, out_;
  double last_{0.0}, step_{0.0}, period_{0.0};
  bool started_{false}, anew_{false};
};

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
