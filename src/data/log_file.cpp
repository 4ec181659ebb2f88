#include "log_file.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/ranges.h>

#include "column_words.hpp"
#include "csv_fields.hpp"

namespace heft::data {
namespace {

/// Rows that arrive with times that increase among themselves, but not beyond what was there before: after as many it
/// is the clock that was set, not a row that is wrong.
constexpr int kClockSet = 10;

}  // namespace

LogFile::LogFile(const std::string& path, const LogRequirements& needs, Reading reading)
    : path_(path), needs_(needs), reading_(reading) {
  reader_ = open_log(path, needs.as, reading);
  text_ = dynamic_cast<TextReader*>(reader_.get());
  header_ = text_ != nullptr ? text_->place() : path_;
  last_line_ = line();
  for (const LogColumn& column : reader_->columns()) columns_.push_back({column.name});
  file_columns_ = columns_.size();
  if (!has("time")) {
    rate_ = given_rate(needs.as, path);
    if (rate_ > 0.0) columns_.push_back({"time"});
  }
  find_channels();
  check_required();
  for (std::size_t c = 0; c < file_columns_ && text_ != nullptr; ++c) {
    if (columns_[c].known) text_->require(c);
  }
}

std::size_t LogFile::find_column(std::string_view name) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].name == name) return c;
  }
  return columns_.size();
}

std::string LogFile::column_list() const {
  constexpr std::size_t kMostColumns = 30;
  std::string list;
  for (std::size_t c = 0; c < std::min(columns_.size(), kMostColumns); ++c) {
    list += fmt::format("{}{}", c == 0 ? "" : ", ", shown(columns_[c].name));
  }
  if (columns_.size() > kMostColumns) list += fmt::format(", ... ({} in all)", columns_.size());
  return list;
}

/// Highest joint number of a channel, 0 when it is absent.
int LogFile::highest(std::string_view prefix) const {
  int most = 0;
  for (const Column& column : columns_) most = std::max(most, joint_number(column.name, prefix));
  return most;
}

/// First joint of 1..count that the channel lacks, 0 when complete.
int LogFile::first_missing(std::string_view prefix, int count) const {
  for (int joint = 1; joint <= count; ++joint) {
    if (!has(fmt::format("{}{}", prefix, joint))) return joint;
  }
  return 0;
}

/// What a message suggests where a group of columns is missing: columns with numbers that nothing is known of, such as
/// ", or say which they are: --map q=pose (pose_0 to pose_5)"; "" when there are none.
std::string LogFile::or_map(std::string_view prefix) const {
  constexpr std::size_t kMostGroups = 4;
  std::vector<std::pair<std::string, std::vector<std::string>>> groups;
  for (const Column& column : columns_) {
    const HeaderParts parts = parts_of(column.name);
    if (column.known || parts.index < 0) continue;
    const auto same = std::find_if(groups.begin(), groups.end(),
                                   [&](const auto& group) { return group.first == parts.stem; });
    if (same == groups.end()) {
      groups.push_back({parts.stem, {column.name}});
    } else {
      same->second.push_back(column.name);
    }
  }
  std::string text;
  std::size_t count = 0;
  for (const auto& [stem, names] : groups) {
    if (names.size() < 2 ||
        (needs_.num_joints > 0 && names.size() < static_cast<std::size_t>(needs_.num_joints)))
      continue;
    if (count++ == kMostGroups) break;
    text += fmt::format("{}--map {}={} ({} to {})", count == 1 ? ", or say which they are: " : ", ", prefix,
                        shown(stem), shown(names.front()), shown(names.back()));
  }
  return text;
}

void LogFile::find_channels() {
  if (!has("time")) {
    fail(
        header_,
        "column 'time' is missing; found {}; expected a column time [s]; add it, say which column it is (--map "
        "time=COLUMN), or give the rate of the rows (--map time=500Hz)",
        column_list());
  }
  num_joints_ = highest("q");
  if (num_joints_ == 0) {
    fail(header_,
         "column 'q1' is missing; found {}; expected joint positions q1, q2, ... [rad, m]; add them{}",
         column_list(), or_map("q"));
  }
  if (const int gap = first_missing("q", num_joints_); gap != 0) {
    fail(header_,
         "column 'q{}' is missing though 'q{}' is there; expected q1 to q{} without a gap; add or rename it",
         gap, num_joints_, num_joints_);
  }
  if (needs_.num_joints != 0 && needs_.num_joints != num_joints_) {
    const std::string robot = needs_.robot_name.empty() ? "the robot" : "robot '" + needs_.robot_name + "'";
    fail(header_,
         "column 'q{}': the log has {} joints (q1 to q{}), {} has {}; expected q1 to q{}; "
         "give the log of this robot or name the right URDF, base and tip link",
         num_joints_, num_joints_, num_joints_, robot, needs_.num_joints, needs_.num_joints);
  }
  time_column_ = find_column("time");
  columns_[time_column_].known = true;
  for (std::size_t k = 0; k < kChannels.size(); ++k) {
    complete_[k] = first_missing(kChannels[k].prefix, num_joints_) == 0;
    if (!complete_[k]) continue;
    for (int joint = 1; joint <= num_joints_; ++joint) {
      columns_[find_column(fmt::format("{}{}", kChannels[k].prefix, joint))].known = true;
    }
  }
}

bool LogFile::has_channel(Eigen::MatrixXd Log::*matrix) const {
  for (std::size_t k = 0; k < kChannels.size(); ++k) {
    if (kChannels[k].matrix == matrix) return complete_[k];
  }
  return false;
}

std::string LogFile::unused_torque_constants() const {
  return needs_.torque_constant.empty() || use_current_
             ? ""
             : fmt::format(
                   "{}: the torque is that of columns tau1..; torque constants are for logs without them",
                   path_);
}

double LogFile::torque_constant(int joint) const {
  const std::vector<double>& constant = needs_.torque_constant;
  return constant.size() == 1 ? constant[0] : constant[static_cast<std::size_t>(joint)];
}

void LogFile::require_channel(std::string_view prefix, Eigen::MatrixXd Log::*matrix, std::string_view meaning,
                              std::string_view remedy) const {
  if (has_channel(matrix)) return;
  fail(header_, "column '{}{}' is missing; found {}; expected {} {}1 to {}{}; {}{}", prefix,
       first_missing(prefix, num_joints_), column_list(), meaning, prefix, prefix, num_joints_, remedy,
       or_map(prefix));
}

void LogFile::check_required() {
  if (needs_.velocity) {
    require_channel("qd", &Log::qd, "joint velocities [rad/s, m/s]",
                    "add them or let them be derived from q");
  }
  if (needs_.acceleration) {
    require_channel("qdd", &Log::qdd, "joint accelerations [rad/s^2, m/s^2]",
                    "add them or let them be derived from q");
  }
  const std::size_t constants = needs_.torque_constant.size();
  if (constants > 1 && constants != static_cast<std::size_t>(num_joints_)) {
    fail(header_,
         "column 'i1': {} torque constants were given, the log has {} joints; expected 1 or {}; give one for "
         "all joints or one for each",
         constants, num_joints_, num_joints_);
  }
  for (const double constant : needs_.torque_constant) {
    if (!std::isfinite(constant) || constant == 0.0) {
      fail(header_,
           "column 'i1': the torque constant {} cannot be used; expected a finite value other than 0 [Nm/A]",
           constant);
    }
  }
  use_current_ = !has_channel(&Log::tau) && has_channel(&Log::current) && constants > 0;
  if (needs_.torque && !use_current_) {
    std::string_view remedy = "add the measured torques";
    if (has_channel(&Log::current)) {
      remedy =
          "add the measured torques, or give the torque constant [Nm/A] so that the currents i1.. can be "
          "used";
    } else if (constants > 0) {
      remedy = "add the measured torques or all currents i1..";
    }
    require_channel("tau", &Log::tau, "joint torques [Nm, N]", remedy);
  }
}

void LogFile::want_only(const std::vector<std::size_t>& columns) {
  for (Column& column : columns_) column.wanted = false;
  for (const std::size_t c : columns) columns_[c].wanted = true;
  columns_[time_column_].wanted = true;
  std::vector<std::size_t> of_file;
  for (std::size_t c = 0; c < file_columns_; ++c) {
    if (columns_[c].wanted) of_file.push_back(c);
  }
  reader_->want_only(of_file);
}

bool LogFile::next(double* values) {
  if (!reader_->next(values)) return false;
  if (rate_ > 0.0) values[time_column_] = static_cast<double>(num_rows_) / rate_;
  if (text_ == nullptr) check_finite(values);
  check_time(values[time_column_]);
  ++num_rows_;
  return true;
}

/// Checks the times of rows of text, in their last column where the file has them.
void LogFile::take_text_times(const TextRows& read, FileRows& rows) {
  const Eigen::Index count = read.values.rows();
  if (rate_ > 0.0) {
    rows.time.resize(count);
    for (Eigen::Index k = 0; k < count; ++k) rows.time[k] = static_cast<double>(num_rows_ + k) / rate_;
  } else {
    rows.time = read.values.col(read.values.cols() - 1);
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    if (num_rows_ == 0 || !(rows.time[k] > last_time_)) {
      // Of several rows at once the last was read already: messages are about this one.
      if (num_rows_ > 0 && k > 0) last_line_ = read.line_of(k - 1);
      text_->stand_at(read.line_of(k));
      check_time(rows.time[k]);
    }
    last_time_ = rows.time[k];
    ++num_rows_;
  }
  last_line_ = read.line_of(count - 1);
}

void LogFile::for_each_rows(const std::vector<FileColumn>& columns,
                            const std::function<void(const FileRows&)>& use) {
  const auto wanted = static_cast<Eigen::Index>(columns.size());
  FileRows rows;
  const auto scale = [&] {
    for (Eigen::Index c = 0; c < wanted; ++c) {
      const double factor = columns[static_cast<std::size_t>(c)].factor;
      if (factor != 1.0) rows.values.col(c) *= factor;
    }
    use(rows);
  };
  if (text_ != nullptr) {
    // A column may be asked for twice: as it is, and times a torque constant.
    std::vector<std::size_t> numbers;
    std::vector<Eigen::Index> places;
    for (const FileColumn& column : columns) {
      const auto place = std::find(numbers.begin(), numbers.end(), column.column);
      places.push_back(place - numbers.begin());
      if (place == numbers.end()) numbers.push_back(column.column);
    }
    if (rate_ == 0.0) numbers.push_back(time_column_);
    text_->for_each_rows(numbers, [&](const TextRows& read) {
      take_text_times(read, rows);
      rows.values = read.values(Eigen::all, places);
      scale();
    });
    return;
  }
  constexpr Eigen::Index kRows = 2048;
  std::vector<double> row(num_columns(), 0.0);
  for (bool more = true; more;) {
    rows.time.resize(kRows);
    rows.values.resize(kRows, wanted);
    Eigen::Index count = 0;
    while (count < kRows && (more = next(row.data()))) {
      rows.time[count] = row[time_column_];
      for (Eigen::Index c = 0; c < wanted; ++c)
        rows.values(count, c) = row[columns[static_cast<std::size_t>(c)].column];
      ++count;
    }
    if (count == 0) return;
    rows.time.conservativeResize(count);
    rows.values.conservativeResize(count, Eigen::NoChange);
    scale();
  }
}

/// Text readers look at every number themselves; binary formats hold what is no number.
void LogFile::check_finite(const double* values) {
  for (std::size_t c = 0; c < file_columns_; ++c) {
    Column& column = columns_[c];
    if (!column.wanted || column.dropped || std::isfinite(values[c])) continue;
    if (column.known) {
      fail(reader_->place(),
           "column '{}': found '{}'; expected a finite number; remove the row or repair the value",
           column.name, values[c]);
    }
    dropped_.push_back(fmt::format("{} ('{}' at {})", column.name, values[c], reader_->place()));
    column.dropped = true;
  }
}

void LogFile::check_time(double time) {
  if (num_rows_ > 0 && !(time > last_time_)) {
    other_rows_ = other_rows_ > 0 && time > other_time_ ? other_rows_ + 1 : 1;
    other_time_ = time;
    if (reading_ == Reading::kWhole || other_rows_ < kClockSet) {
      fail(reader_->place(),
           "column 'time': found {} after {}{}; expected time to increase with every row; "
           "remove repeated rows or sort the log",
           time, last_time_, text_ != nullptr ? fmt::format(" (line {})", last_line_) : "");
    }
  }
  other_rows_ = 0;
  last_time_ = time;
  last_line_ = line();
}

void LogFile::check_length() const {
  const int least = std::max(needs_.min_samples, 1);
  if (num_rows_ < least) {
    fail(text_ != nullptr ? fmt::format("{}:{}", path_, last_line_) : path_,
         "column 'time': the log ends after {} samples; expected at least {}; give a longer log", num_rows_,
         least);
  }
}

/// Columns of the README beyond the channels, which some questions use.
static bool is_documented(const std::string& name) {
  const std::string group = name.substr(0, name.find_first_of("0123456789"));
  return group == "tauref" || group == "iref" || group == "qlink" || group == "taulink";
}

std::string LogFile::note(const std::vector<std::size_t>& used) const {
  std::string kept;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const Column& column = columns_[c];
    if (column.known || is_dropped(c) || std::find(used.begin(), used.end(), c) != used.end()) continue;
    if (is_documented(column.name) || column.name == kNanosecondsPart) continue;
    kept += fmt::format("{}{}", kept.empty() ? "" : ", ", column.name);
  }
  const std::vector<std::string>& dropped = text_ != nullptr ? text_->dropped() : dropped_;
  std::vector<std::string> parts;
  if (!kept.empty()) parts.push_back(fmt::format("columns carried along without use: {}", kept));
  if (!dropped.empty()) {
    parts.push_back(
        fmt::format("columns ignored because they do not hold numbers only: {}", fmt::join(dropped, ", ")));
  }
  for (std::size_t k = 0; k < kChannels.size(); ++k) {
    const std::string_view prefix = kChannels[k].prefix;
    if (complete_[k] || highest(prefix) == 0) continue;
    parts.push_back(
        fmt::format("columns {0}.. ignored because {0}{1} is missing", prefix, first_missing(prefix, num_joints_)));
  }
  return parts.empty() ? "" : fmt::format("{}: {}", path_, fmt::join(parts, "; "));
}

void LogFile::close() {
  how_ = how_read();
  for (std::size_t c = 0; c < columns_.size(); ++c) columns_[c].dropped = is_dropped(c);
  if (text_ != nullptr) dropped_ = text_->dropped();
  text_ = nullptr;
  reader_.reset();
}

std::string LogFile::how_read() const {
  if (!reader_) return how_;
  std::string how = understood(reader_->columns());
  if (rate_ > 0.0) how += fmt::format("{}time from {:g} rows a second", how.empty() ? "" : "; ", rate_);
  for (const std::string& note : reader_->notes()) how += fmt::format("{}{}", how.empty() ? "" : "; ", note);
  if (how.empty() && reader_->format() == "CSV") return {};
  return fmt::format("{}: read as {}{}{}", path_, reader_->format(), how.empty() ? "" : ": ", how);
}

}  // namespace heft::data
