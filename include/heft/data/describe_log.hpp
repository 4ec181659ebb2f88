/// @file
/// What does a file hold, and how is it understood? Also the way from any log to heft's CSV.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/data/log_checks.hpp"

namespace heft::data {

/// A column of a log.
struct DescribedColumn {
  std::string name;    ///< heft's, where it is recognised
  std::string origin;  ///< the file's
  double factor{1.0};  ///< to SI units
  double shift{0.0};   ///< added after that
  bool known{false};   ///< in a group that heft has a name for
  bool numbers{true};  ///< false: text was found in it
  double least{std::numeric_limits<double>::infinity()},
      most{-std::numeric_limits<double>::infinity()};  ///< SI
};

/// What a group of questions needs of a log.
struct Question {
  std::string commands;  ///< "identify, diagnose, validate, payload, monitor"
  std::string missing;   ///< "torque: tau1.., or i1.. with torque constants"; empty: nothing
};

/// What the torque of a log shows itself to be.
enum class TorqueKind {
  kNone,       ///< the log has none
  kMeasured,   ///< nothing speaks against it
  kReference,  ///< equal to the controller's target torque to the last bit: commanded
  kRepeated,   ///< the same to the last bit in another log, of another motion: commanded
  kCurrent     ///< a constant times the current, joint by joint
};

struct LogDescription {
  std::string path;
  std::string format;  ///< "text separated by blanks", "MCAP (zstd), topic /joint_states"
  std::string
      understood;  ///< which columns were taken for which, and their units; empty: a log in heft's own words
  std::vector<DescribedColumn> columns;
  int num_joints{0};
  long rows{0};
  double begin{0.0}, end{0.0};  ///< time of the first and last row [s]
  double period{0.0};           ///< median [s]; 0 where there is none
  double longest_period{0.0};   ///< [s]
  double longest_from{0.0};     ///< when it begins [s]
  long gaps{0};                 ///< periods of more than ten times the median
  long backwards{0};            ///< rows whose time does not increase
  TorqueKind torque{TorqueKind::kNone};
  std::string repeated_in{};              ///< kRepeated: path of the other log
  std::vector<double> torque_constant{};  ///< kCurrent: [N·m/A] a joint
  std::vector<Question> questions;
  std::vector<LogFinding> findings;  ///< what cannot be right (log_checks)
  std::vector<std::string> notes;    ///< of the file as a whole: a cut tail, columns that hold text

  /// The log can be given to a command: it has time and positions, time increases, and nothing in it is wrong for certain.
  bool usable() const;
};

/// Reads each log once; memory does not grow with them. A log that lacks columns is described as far as it goes.
/// @throws DataError for a file that cannot be read as a log at all
std::vector<LogDescription> describe_logs(const std::vector<std::string>& paths, const ReadAs& as = {});

/// What became of logs that were written as one.
struct LogConversion {
  long rows{0};              ///< written
  long left_out{0};          ///< rows of the first log without a partner in the others
  double largest_step{0.0};  ///< between the stamps of rows that were joined [s]
  std::vector<std::string> notes;
};

/// Writes a log as heft's CSV, row by row. Several, such as one a signal, are joined by time: rows whose stamps differ by
/// less than half a period of the first log. Where none has a time, a rate (`time=500Hz` in ReadAs::map) joins them row by row.
/// @throws DataError for a log without columns that heft knows, for a column in two of them, and for logs that do not belong
///         together; nothing is written then
LogConversion convert_logs(const std::vector<std::string>& paths, const ReadAs& as,
                           const std::string& output);

}  // namespace heft::data
