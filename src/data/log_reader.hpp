/// @file
/// The formats in which a log may come: each one file in `readers/` and one entry in log_formats.cpp.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "heft/data/log.hpp"

namespace heft::data {

/// A column as heft understands it.
struct LogColumn {
  std::string name;  ///< heft's ("time", "q1", "tau3") where it is recognised; otherwise the file's own
  std::string
      origin{};  ///< as the file has it: "actual_q_0", "q1 [deg]", "/joint_states position of 'elbow_joint'"
  double factor{1.0};  ///< what the file's numbers were multiplied by to make SI units
  double shift{0.0};   ///< added after that
};

/// Rows of a log from front to back, in heft's columns and SI units. Memory does not grow with the log.
class LogReader {
 public:
  virtual ~LogReader() = default;

  /// What a person calls the format: "CSV with semicolons and decimal commas", "MCAP (zstd), topic /joint_states".
  virtual std::string format() const = 0;
  virtual const std::vector<LogColumn>& columns() const = 0;
  /// Only these columns are read from now on; what is not wanted stays as it was in next().
  virtual void want_only(const std::vector<std::size_t>& columns) = 0;
  /// Reads the next row into values[0..columns().size()). Numbers may be NaN or infinite where the file says so.
  /// @return false at the end
  /// @throws DataError naming the place: what was found, what was expected, what to do
  virtual bool next(double* values) = 0;
  /// Where the row read last is, for messages: "run.csv:17", "run.mcap: message 17 of /joint_states".
  virtual std::string place() const = 0;
  /// Part of the file that was read, 0..1.
  virtual double part_read() const = 0;
  /// What is worth telling about the file as a whole, known at the end of it: a cut tail, messages left out.
  virtual std::vector<std::string> notes() const { return {}; }
};

/// A format: how it shows in the first bytes, and its reader.
struct LogFormat {
  std::string_view id;  ///< "mcap", for `heft log` and messages
  /// @param head  up to 64 kB from the front of the file
  bool (*recognises)(std::string_view head);
  /// @throws DataError
  std::unique_ptr<LogReader> (*open)(const std::string& path, const ReadAs& as);
};

/// Every format that is not text.
std::span<const LogFormat> binary_formats();

/// The format of a folder that is a log (a recording of ROS 2 in several files); null for any other path.
const LogFormat* folder_format(const std::string& path);

/// What columns of other programs are in heft's words: names ("actual_q_0", "position[2]", "tau_J[6]"), joints counted
/// from 0 or 1 (decided over all columns), units in the header ("q1 [deg]", "time_ms"), and what `as.map` says.
/// Columns that nothing is known of keep their names. Of a time in two columns the seconds are "time", the nanoseconds
/// kNanosecondsPart. Names of `as.map` that are not among the headers are passed over: see refuse_unused_map().
/// @param where  in front of messages: "run.csv:1"
/// @throws DataError for a unit that is not known, for two columns that would have one name, and for a name in `as.map`
///         that is none of heft's
std::vector<LogColumn> in_heft_words(const std::vector<std::string>& headers, const ReadAs& as,
                                     std::string_view where = {});

/// @throws DataError for an entry of `as.map` that named no column of a log
void refuse_unused_map(const std::vector<LogColumn>& columns, const ReadAs& as, std::string_view where);

inline constexpr std::string_view kNanosecondsPart = "time+ns";

/// Which columns were taken for which, and what was converted: "q from actual_q_0 to actual_q_5, time from timestamp;
/// positions in degrees"; empty for a log in heft's own words.
std::string understood(const std::vector<LogColumn>& columns);

/// Rows a second that `as.map` gives a log without time ("time=500Hz"); 0: none.
/// @throws DataError for a rate that is none
double given_rate(const ReadAs& as, std::string_view where);

}  // namespace heft::data
