#include "log_file.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <string_view>

#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "csv_fields.hpp"

namespace heft::data {
namespace {

/// Bytes taken from the file at once.
constexpr std::size_t kBlock = std::size_t{1} << 18;

/// Rows that arrive with times that increase among themselves, but not beyond what was there before: after as many it
/// is the clock that was set, not a row that is wrong.
constexpr int kClockSet = 10;

/// Longest line: far more than 10 000 columns take. What is longer is no log, and would fill the memory.
constexpr std::size_t kLongestLine = std::size_t{1} << 24;

/// Joint number of `name` under `prefix` (q3 under "q" gives 3), 0 when it is not of that channel.
int joint_number(std::string_view name, std::string_view prefix) {
  if (name.size() <= prefix.size() || name.substr(0, prefix.size()) != prefix) return 0;
  name.remove_prefix(prefix.size());
  if (name.front() == '0' || name.size() > 4) return 0;
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return (error == std::errc() && end == name.data() + name.size() && number > 0) ? number : 0;
}

/// The text of the field that holds `at`, for messages.
std::string_view field_around(const char* begin, const char* end) {
  const char* stop = begin;
  while (stop != end && *stop != ',' && *stop != '\n') ++stop;
  std::string_view field(begin, static_cast<std::size_t>(stop - begin));
  if (!field.empty() && field.back() == '\r') field.remove_suffix(1);
  return trim(field);
}

std::size_t count_fields(const char* line_begin, const char* line_end) {
  return static_cast<std::size_t>(std::count(line_begin, line_end, ',')) + 1;
}

}  // namespace

LogFile::LogFile(const std::string& path, const LogRequirements& needs, Reading reading)
    : path_(path), needs_(needs), reading_(reading) {
  open();
  read_header();
  find_channels();
  check_required();
}

void LogFile::open() {
  std::error_code ignored;
  if (std::filesystem::is_directory(path_, ignored)) {
    throw DataError(fmt::format("{}: is a folder; expected a log file", path_));
  }
  file_ = host::open_input(path_);
  if (!file_) {
    throw DataError(fmt::format("{}: cannot read the log: {}; check the path", path_, std::strerror(errno)));
  }
  struct stat status {};
  const bool is_file = ::fstat(::fileno(file_.get()), &status) == 0 && S_ISREG(status.st_mode);
  file_size_ = is_file ? static_cast<double>(status.st_size) : 0.0;
  buffer_.resize(kBlock);
}

/// Takes more of the file behind what is left in the buffer. @return false when the file has no more
bool LogFile::fill() {
  if (at_end_) return false;
  std::memmove(buffer_.data(), buffer_.data() + at_, filled_ - at_);
  filled_ -= at_;
  at_ = 0;
  if (filled_ == buffer_.size()) {  // a line longer than the buffer
    if (filled_ >= kLongestLine) {
      fail(line_ + 1,
           "found a line of more than {} million bytes; expected rows of numbers (CSV); this is no log",
           kLongestLine >> 20);
    }
    buffer_.resize(2 * buffer_.size());
  }
  char* const to = buffer_.data() + filled_;
  const std::size_t room = buffer_.size() - filled_;
  std::size_t count = 0;
  bool failed = false;
  if (reading_ == Reading::kArriving) {  // fread would wait until the buffer is full
    ssize_t got = 0;
    do got = ::read(::fileno(file_.get()), to, room);
    while (got < 0 && errno == EINTR);
    failed = got < 0;
    count = failed ? 0 : static_cast<std::size_t>(got);
  } else {
    count = std::fread(to, 1, room, file_.get());
    failed = count == 0 && std::ferror(file_.get()) != 0;
  }
  if (count == 0) {
    at_end_ = true;
    if (failed) {
      throw DataError(fmt::format("{}: reading stopped: {}; check the disk", path_, std::strerror(errno)));
    }
    return false;
  }
  if (reading_ == Reading::kWhole && std::memchr(to, '\0', count) != nullptr) {
    fail(line_ + 1,
         "found a zero byte in this line or soon behind it; expected text (CSV); this is a binary file, "
         "text of another encoding than UTF-8, or a log that was not written to its end; convert it");
  }
  filled_ += count;
  bytes_read_ += static_cast<double>(count);
  return true;
}

/// Moves to the next line, which is in the buffer as a whole. @return false at the end of the file
bool LogFile::next_line() {
  std::size_t searched = 0;
  for (;;) {
    const char* const begin = buffer_.data() + at_;
    const std::size_t count = filled_ - at_;
    const void* stop = std::memchr(begin + searched, '\n', count - searched);
    if (stop == nullptr) {
      searched = count;
      if (fill()) continue;
      if (filled_ == at_) return false;
    }
    line_begin_ = buffer_.data() + at_;
    line_end_ = (stop != nullptr) ? static_cast<const char*>(stop) : buffer_.data() + filled_;
    at_ = static_cast<std::size_t>(line_end_ - buffer_.data()) + (stop != nullptr ? 1 : 0);
    ++line_;
    terminated_ = stop != nullptr;
    return true;
  }
}

/// A log that was cut inside its last number still looks like a row. Where all rows have as many decimals, fewer at the
/// end of the file give it away.
void LogFile::look_at_end_of_line() {
  constexpr int kMost = 32;
  constexpr long kEnoughRows = 10;
  if (decimals_ == -2) return;
  int count = -1, digits = 0;
  for (const char* at = line_end_; at != line_begin_ && digits < kMost; ++digits) {
    const char c = *--at;
    if (c == '\r' || c == ' ') --digits;
    if (c == '.') count = digits;
    if (c == '.' || c == ',') break;
  }
  if (decimals_ == -1) decimals_ = count;
  if (count == decimals_) return;
  if (!terminated_ && num_rows_ >= kEnoughRows && decimals_ > 0 && count < decimals_) {
    const char* field = line_end_;
    while (field != line_begin_ && field[-1] != ',') --field;
    fail(line_,
         "column '{}': found '{}' and the end of the file; expected {} decimals as in every row before, and "
         "a line "
         "feed: the log was cut inside this number; remove the line",
         columns_.back().name, shown(field_around(field, line_end_)), decimals_);
  }
  decimals_ = -2;
}

void LogFile::read_header() {
  fill();
  // Spreadsheets put a byte-order mark in front.
  if (filled_ >= 3 && std::memcmp(buffer_.data(), "\xEF\xBB\xBF", 3) == 0) at_ = 3;
  const bool has_line = next_line();
  std::string_view line(line_begin_, static_cast<std::size_t>(line_end_ - line_begin_));
  if (!has_line || is_blank(line)) {
    // A blank first line is no header, whatever follows; only the message differs.
    bool empty = true;
    while (has_line && empty && next_line()) {
      empty = is_blank({line_begin_, static_cast<std::size_t>(line_end_ - line_begin_)});
    }
    if (empty) {
      throw DataError(fmt::format(
          "{}: the log is empty; expected a header line (time,q1,...) and rows of numbers", path_));
    }
    line = {};
  }
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);

  const std::vector<std::string_view> names = split(line);
  if (names.size() == 1 && line.find_first_of(";\t") != std::string_view::npos) {
    fail(1, "the header has no comma but {}; expected fields separated by commas; convert the file",
         line.find(';') != std::string_view::npos ? "semicolons" : "tabs");
  }
  double number = 0.0;
  const char* at = line.data();
  if (read_number(at, line.data() + line.size(), number) == FieldProblem::kNone) {
    fail(1,
         "column 1: found the number '{}' where a name is due; expected a header line such as time,q1,q2; "
         "put the column names into the first line",
         shown(names.front()));
  }
  std::map<std::string_view, std::size_t> seen;
  for (std::size_t c = 0; c < names.size(); ++c) {
    Column column;
    column.name = names[c].empty() ? fmt::format("unnamed_{}", c + 1) : std::string(names[c]);
    if (!names[c].empty()) {
      const auto [before, is_new] = seen.emplace(names[c], c + 1);
      if (!is_new) {
        fail(1, "column '{}' is there twice (fields {} and {}); expected every name once; rename or drop one",
             column.name, before->second, c + 1);
      }
    }
    columns_.push_back(std::move(column));
  }
}

std::size_t LogFile::find_column(std::string_view name) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].name == name) return c;
  }
  return columns_.size();
}

std::string LogFile::column_list() const {
  constexpr std::size_t kMost = 30;
  std::string list;
  for (std::size_t c = 0; c < std::min(columns_.size(), kMost); ++c) {
    list += fmt::format("{}{}", c == 0 ? "" : ", ", shown(columns_[c].name));
  }
  if (columns_.size() > kMost) list += fmt::format(", ... ({} in all)", columns_.size());
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

void LogFile::find_channels() {
  if (!has("time")) {
    fail(1, "column 'time' is missing; found {}; expected a column time [s]; add it", column_list());
  }
  num_joints_ = highest("q");
  if (num_joints_ == 0) {
    fail(1, "column 'q1' is missing; found {}; expected joint positions q1, q2, ... [rad, m]; add them{}",
         column_list(), has("q0") ? " (joints are counted from 1, not from q0)" : "");
  }
  if (const int gap = first_missing("q", num_joints_); gap != 0) {
    fail(1,
         "column 'q{}' is missing though 'q{}' is there; expected q1 to q{} without a gap; add or rename it",
         gap, num_joints_, num_joints_);
  }
  if (needs_.num_joints != 0 && needs_.num_joints != num_joints_) {
    const std::string robot = needs_.robot_name.empty() ? "the robot" : "robot '" + needs_.robot_name + "'";
    fail(1,
         "column 'q{}': the log has {} joints (q1 to q{}), {} has {}; expected q1 to q{}{}; "
         "give the log of this robot or name the right URDF, base and tip link",
         num_joints_, num_joints_, num_joints_, robot, needs_.num_joints, needs_.num_joints,
         has("q0") ? " (joints are counted from 1, not from q0)" : "");
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
  fail(1, "column '{}{}' is missing; found {}; expected {} {}1 to {}{}; {}", prefix,
       first_missing(prefix, num_joints_), column_list(), meaning, prefix, prefix, num_joints_, remedy);
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
    fail(1,
         "column 'i1': {} torque constants were given, the log has {} joints; expected 1 or {}; give one for "
         "all joints or one for each",
         constants, num_joints_, num_joints_);
  }
  for (const double constant : needs_.torque_constant) {
    if (!std::isfinite(constant) || constant == 0.0) {
      fail(1,
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
}

bool LogFile::next(double* values) {
  std::size_t blank_line = 0;  // first of a run of blank lines: harmless at the end of the file only
  for (;;) {
    if (!next_line()) return false;
    if (!is_blank({line_begin_, static_cast<std::size_t>(line_end_ - line_begin_)})) break;
    if (blank_line == 0) blank_line = line_;
  }
  if (blank_line != 0 && reading_ == Reading::kWhole) {
    fail(blank_line,
         "column 'time': found a blank line between rows; expected {} fields in every row; "
         "remove the blank line",
         columns_.size());
  }
  const char* at = line_begin_;
  const char* const end = line_end_;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (c > 0) {
      if (at == end || *at != ',') fail_ragged();
      ++at;
    }
    const Column& column = columns_[c];
    const char* const begin = at;
    if (column.wanted && !column.dropped) {
      const FieldProblem problem = read_number(at, end, values[c]);
      if (problem == FieldProblem::kNone) [[likely]]
        continue;
      refuse_field(c, begin, static_cast<int>(problem));
    }
    const void* comma = std::memchr(begin, ',', static_cast<std::size_t>(end - begin));
    at = (comma != nullptr) ? static_cast<const char*>(comma) : end;
  }
  if (at != end && *at == ',') fail_ragged();

  check_time(values[time_column_]);
  look_at_end_of_line();
  ++num_rows_;
  return true;
}

void LogFile::check_time(double time) {
  if (num_rows_ > 0 && !(time > last_time_)) {
    other_rows_ = other_rows_ > 0 && time > other_time_ ? other_rows_ + 1 : 1;
    other_time_ = time;
    if (reading_ == Reading::kWhole || other_rows_ < kClockSet) {
      fail(line_,
           "column 'time': found {} after {} (line {}); expected time to increase with every row; "
           "remove repeated rows or sort the log",
           time, last_time_, last_line_);
    }
  }
  other_rows_ = 0;
  last_time_ = time;
  last_line_ = line_;
}

/// Throws for a field of a known channel; drops the column otherwise.
void LogFile::refuse_field(std::size_t index, const char* begin, int problem) {
  Column& column = columns_[index];
  const std::string_view field = field_around(begin, line_end_);
  if (!column.known) {
    // A number is due only in known channels: the others are dropped at the first text.
    dropped_.push_back(fmt::format("{} ('{}' in line {})", column.name, shown(field), line_));
    column.dropped = true;
    return;
  }
  switch (static_cast<FieldProblem>(problem)) {
    case FieldProblem::kEmpty:
      // A short row may end in the middle of the numbers: say that rather than "empty field".
      if (count_fields(line_begin_, line_end_) != columns_.size()) fail_ragged();
      fail(line_, "column '{}': found an empty field; expected a number; fill it or remove the row",
           column.name);
    case FieldProblem::kNotFinite:
      fail(line_, "column '{}': found '{}'; expected a finite number; remove the row or repair the value",
           column.name, shown(field));
    case FieldProblem::kTooLarge:
      fail(line_, "column '{}': found '{}', which is too large; expected a finite number in SI units",
           column.name, shown(field));
    case FieldProblem::kText:
    case FieldProblem::kNone: break;
  }
  fail(line_,
       "column '{}': found '{}'; expected a number (decimal point, no unit); correct or remove the row",
       column.name, shown(field));
}

void LogFile::fail_ragged() const {
  const std::size_t found = count_fields(line_begin_, line_end_);
  if (found < columns_.size()) {
    fail(line_,
         "column '{}' is missing: found {} fields; expected {} as in the header; complete or remove the row",
         columns_[found].name, found, columns_.size());
  }
  fail(line_,
       "column '{}' is followed by more fields: found {}; expected {} as in the header; "
       "remove the surplus (a decimal comma also looks like this)",
       columns_.back().name, found, columns_.size());
}

void LogFile::check_length() const {
  const int least = std::max(needs_.min_samples, 1);
  if (num_rows_ < least) {
    fail(static_cast<std::size_t>(num_rows_) + 1,
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
    if (column.known || column.dropped || std::find(used.begin(), used.end(), c) != used.end()) continue;
    if (is_documented(column.name)) continue;
    kept += fmt::format("{}{}", kept.empty() ? "" : ", ", column.name);
  }
  if (kept.empty() && dropped_.empty()) return {};
  std::string text = fmt::format("{}: ", path_);
  if (!kept.empty()) text += fmt::format("columns carried along without use: {}", kept);
  if (!dropped_.empty()) {
    text += fmt::format("{}columns ignored because they do not hold numbers only: {}",
                        kept.empty() ? "" : "; ", fmt::join(dropped_, ", "));
  }
  return text;
}

double LogFile::part_read() const { return file_size_ > 0.0 ? std::min(1.0, bytes_read_ / file_size_) : 0.0; }

}  // namespace heft::data
