/// @file
/// One header of a log: what it may mean in heft's words. What it does mean is decided over all of them (column_names).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "units.hpp"

namespace heft::data {

/// A group of columns that heft has a name for.
struct ColumnGroup {
  std::string_view name;   ///< "tau"; joints are counted behind it
  std::string_view words;  ///< "torques"
  Quantity quantity;
};
/// Every group, `time` first.
std::span<const ColumnGroup> column_groups();
/// Null when heft has no such group.
const ColumnGroup* find_group(std::string_view name);

/// How sure a name is, best first.
enum class NameKind {
  kMapped,   ///< named by ReadAs::map
  kHeft,     ///< heft's own: time, q1, tau3
  kNamed,    ///< what other programs call it
  kWeak,     ///< may be something else beside a better one: theta, moment
  kReceipt,  ///< time at which a recorder got the row; the sender's own stamp is better
};

/// One reading of a header.
struct HeaderWords {
  const ColumnGroup* group{nullptr};
  NameKind kind{NameKind::kNamed};
  int index{-1};                    ///< as the header counts; -1: it does not
  bool from_one{false};             ///< that number is heft's, whatever the others count from
  std::string joint{};              ///< name of the joint, where the header has one instead
  const ColumnUnit* unit{nullptr};  ///< in the header; null: none
  bool nanoseconds_part{false};     ///< of a time in two columns, beside its seconds
  bool seconds_part{false};         ///< of a time in two columns
};

/// A header taken to pieces: "pos [deg]" is "pos" and "deg", "position[2]" is "position" and 2.
struct HeaderParts {
  std::string name;      ///< without the unit
  std::string symbol;    ///< of the unit in brackets, "" when there is none
  std::string stem;      ///< the name without the number at its end
  int index{-1};         ///< that number; -1: none
  bool from_one{false};  ///< that number is heft's, whatever the others count from
};
HeaderParts parts_of(std::string_view header);

/// @param joints  names of the robot's joints; may be empty
/// @param where   in front of messages
/// @throws DataError for a unit that is not known
std::optional<HeaderWords> words_of(std::string_view header, std::span<const std::string> joints,
                                    std::string_view where);

/// Finds the unit of a header for a group: the one in brackets, or null.
/// @throws DataError for one that is not known
const ColumnUnit* unit_of(std::string_view header, const HeaderParts& parts, const ColumnGroup& group,
                          std::string_view where);

/// Joint number of a name of heft under `prefix` (q3 under "q" gives 3), 0 when it is not of that group.
int joint_number(std::string_view name, std::string_view prefix);

}  // namespace heft::data
