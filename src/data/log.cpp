#include "heft/data/log.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::data {
namespace {

/// A channel of the contract: its column prefix, its place in a Log and the unit shown in messages.
struct Channel {
  std::string_view prefix;
  Eigen::MatrixXd Log::*matrix;
  std::string_view meaning;
};

// Order of the contract; also the order in which a log is written.
constexpr std::array<Channel, 8> kChannels{{
    {"q", &Log::q, "joint positions [rad, m]"},
    {"tau", &Log::tau, "joint torques [Nm, N]"},
    {"i", &Log::current, "motor currents [A]"},
    {"qd", &Log::qd, "joint velocities [rad/s, m/s]"},
    {"qdd", &Log::qdd, "joint accelerations [rad/s^2, m/s^2]"},
    {"qref", &Log::qref, "position references [rad, m]"},
    {"qdref", &Log::qdref, "velocity references [rad/s, m/s]"},
    {"temp", &Log::temperature, "joint temperatures [degC]"},
}};

constexpr bool is_space(char c) { return c == ' ' || c == '\t'; }

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Shortens a field for a message, so that a binary file does not flood the terminal.
std::string shown(std::string_view field) {
  constexpr std::size_t kLongest = 40;
  std::string text;
  for (const char c : field.substr(0, kLongest)) text += (static_cast<unsigned char>(c) < 32) ? '?' : c;
  if (field.size() > kLongest) text += "...";
  return text;
}

/// The fields of a line, cut at commas, without surrounding spaces and quotes.
std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    std::string_view field = trim(line.substr(0, comma));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
      field = trim(field.substr(1, field.size() - 2));
    }
    fields.push_back(field);
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

/// Joint number of `name` under `prefix` (q3 under "q" gives 3), 0 when it is not of that channel.
int joint_number(std::string_view name, std::string_view prefix) {
  if (name.size() <= prefix.size() || name.substr(0, prefix.size()) != prefix) return 0;
  name.remove_prefix(prefix.size());
  if (name.front() == '0' || name.size() > 4) return 0;
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return (error == std::errc() && end == name.data() + name.size() && number > 0) ? number : 0;
}

enum class FieldProblem { kNone, kEmpty, kText, kNotFinite, kTooLarge };

/// Reads one number that starts at `at` and must end at a comma, a line end or `end`; moves `at` there.
FieldProblem read_number(const char*& at, const char* end, double& value) {
  while (at != end && is_space(*at)) ++at;
  const char* begin = at;
  if (begin == end || *begin == ',' || *begin == '\n' || *begin == '\r') return FieldProblem::kEmpty;
  if (*begin == '+' && begin + 1 != end && begin[1] != '-') ++begin;  // from_chars takes no plus sign
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error == std::errc::invalid_argument) return FieldProblem::kText;
  if (error == std::errc::result_out_of_range) {
    // Both too large and too small end here; too small is as good as zero.
    value = std::strtod(std::string(begin, stop).c_str(), nullptr);
    if (!(std::abs(value) <= 1.0)) return FieldProblem::kTooLarge;
  }
  at = stop;
  while (at != end && is_space(*at)) ++at;
  if (at != end && *at != ',' && *at != '\n' && !(*at == '\r' && (at + 1 == end || at[1] == '\n'))) {
    return FieldProblem::kText;
  }
  return std::isfinite(value) ? FieldProblem::kNone : FieldProblem::kNotFinite;
}

/// The text of the field that holds `at`, for messages.
std::string_view field_around(const char* begin, const char* end) {
  const char* stop = begin;
  while (stop != end && *stop != ',' && *stop != '\n') ++stop;
  std::string_view field(begin, static_cast<std::size_t>(stop - begin));
  if (!field.empty() && field.back() == '\r') field.remove_suffix(1);
  return trim(field);
}

/// What one column of the file is for.
struct Column {
  std::string name;
  double* target{nullptr};  ///< where its numbers go; null when it is only skipped
  bool known{false};        ///< time or a complete channel: a bad field is an error
  std::size_t extra{0};     ///< index into Log::extra when not known
};

/// Reads one log; its members are what the messages need.
class LogReader {
 public:
  LogReader(const std::string& path, const LogRequirements& needs) : path_(path), needs_(needs) {
    log_.path = path;
  }

  Log read(std::vector<std::string>* notes) {
    load_text();
    read_header();
    find_channels();
    check_required();
    allocate();
    read_rows();
    check_length();
    apply_torque_constant();
    std::erase_if(log_.extra, [](const auto& column) { return column.first.empty(); });
    if (notes != nullptr) write_note(*notes);
    return std::move(log_);
  }

 private:
  template <typename... Args>
  [[noreturn]] void fail(std::size_t line, fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}:{}: {}", path_, line, fmt::format(format, std::forward<Args>(args)...)));
  }

  void load_text() {
    try {
      text_ = host::read_file(path_, "log");
    } catch (const InputError& error) {
      throw DataError(error.what());
    }
    // Spreadsheets put a byte-order mark in front.
    if (text_.size() >= 3 && std::memcmp(text_.data(), "\xEF\xBB\xBF", 3) == 0) text_.erase(0, 3);
    if (trim(text_).find_first_not_of("\r\n") == std::string_view::npos) {
      throw DataError(fmt::format(
          "{}: the log is empty; expected a header line (time,q1,...) and rows of numbers", path_));
    }
  }

  void read_header() {
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    std::string_view line(text_.data(), end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    body_ = std::min(end + 1, text_.size());

    const std::vector<std::string_view> names = split(line);
    if (names.size() == 1 && line.find_first_of(";\t") != std::string_view::npos) {
      fail(1, "the header has no comma but '{}'; expected fields separated by commas; convert the file",
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
          fail(1,
               "column '{}' is there twice (fields {} and {}); expected every name once; rename or drop one",
               column.name, before->second, c + 1);
        }
      }
      columns_.push_back(std::move(column));
    }
  }

  std::size_t find_column(std::string_view name) const {
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      if (columns_[c].name == name) return c;
    }
    return columns_.size();
  }

  bool has(std::string_view name) const { return find_column(name) < columns_.size(); }

  std::string column_list() const {
    constexpr std::size_t kMost = 30;
    std::string list;
    for (std::size_t c = 0; c < std::min(columns_.size(), kMost); ++c) {
      list += fmt::format("{}{}", c == 0 ? "" : ", ", shown(columns_[c].name));
    }
    if (columns_.size() > kMost) list += fmt::format(", ... ({} in all)", columns_.size());
    return list;
  }

  /// Highest joint number of a channel, 0 when it is absent.
  int highest(std::string_view prefix) const {
    int most = 0;
    for (const Column& column : columns_) most = std::max(most, joint_number(column.name, prefix));
    return most;
  }

  /// First joint of 1..count that the channel lacks, 0 when complete.
  int first_missing(std::string_view prefix, int count) const {
    for (int joint = 1; joint <= count; ++joint) {
      if (!has(fmt::format("{}{}", prefix, joint))) return joint;
    }
    return 0;
  }

  void find_channels() {
    if (!has("time")) {
      fail(1, "column 'time' is missing; found {}; expected a column time [s]; add it", column_list());
    }
    num_joints_ = highest("q");
    if (num_joints_ == 0) {
      fail(1, "column 'q1' is missing; found {}; expected joint positions q1, q2, ... [rad, m]; add them{}",
           column_list(), has("q0") ? " (joints are counted from 1, not from q0)" : "");
    }
    if (const int gap = first_missing("q", num_joints_); gap != 0) {
      fail(
          1,
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
    columns_[find_column("time")].known = true;
    for (const Channel& channel : kChannels) {
      complete_.push_back(first_missing(channel.prefix, num_joints_) == 0);
    }
  }

  bool complete(Eigen::MatrixXd Log::*matrix) const {
    for (std::size_t k = 0; k < kChannels.size(); ++k) {
      if (kChannels[k].matrix == matrix) return complete_[k];
    }
    return false;
  }

  void require_channel(std::string_view prefix, Eigen::MatrixXd Log::*matrix, std::string_view meaning,
                       std::string_view remedy) const {
    if (complete(matrix)) return;
    fail(1, "column '{}{}' is missing; found {}; expected {} {}1 to {}{}; {}", prefix,
         first_missing(prefix, num_joints_), column_list(), meaning, prefix, prefix, num_joints_, remedy);
  }

  void check_required() {
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
           "column 'i1': {} torque constants were given, the log has {} joints; expected 1 or {}; give one "
           "for "
           "all joints or one for each",
           constants, num_joints_, num_joints_);
    }
    for (const double constant : needs_.torque_constant) {
      if (!std::isfinite(constant) || constant == 0.0) {
        fail(
            1,
            "column 'i1': the torque constant {} cannot be used; expected a finite value other than 0 [Nm/A]",
            constant);
      }
    }
    use_current_ = !complete(&Log::tau) && complete(&Log::current) && constants > 0;
    if (needs_.torque && !use_current_) {
      std::string_view remedy = "add the measured torques";
      if (complete(&Log::current)) {
        remedy =
            "add the measured torques, or give the torque constant [Nm/A] so that the currents i1.. can be "
            "used";
      } else if (constants > 0) {
        remedy = "add the measured torques or all currents i1..";
      }
      require_channel("tau", &Log::tau, "joint torques [Nm, N]", remedy);
    }
  }

  void allocate() {
    // One row for each line end is an upper bound; blank lines at the end are taken off later.
    const char* begin = text_.data() + body_;
    const char* end = text_.data() + text_.size();
    capacity_ = std::count(begin, end, '\n') + ((begin != end && end[-1] != '\n') ? 1 : 0);

    log_.time.resize(capacity_);
    columns_[find_column("time")].target = log_.time.data();
    for (std::size_t k = 0; k < kChannels.size(); ++k) {
      if (!complete_[k]) continue;
      Eigen::MatrixXd& matrix = log_.*kChannels[k].matrix;
      matrix.resize(capacity_, num_joints_);
      for (int joint = 1; joint <= num_joints_; ++joint) {
        Column& column = columns_[find_column(fmt::format("{}{}", kChannels[k].prefix, joint))];
        column.known = true;
        column.target = matrix.col(joint - 1).data();
      }
    }
    for (Column& column : columns_) {
      if (column.known) continue;
      column.extra = log_.extra.size();
      log_.extra.emplace_back(column.name, Eigen::VectorXd(capacity_));
    }
    for (Column& column : columns_) {
      if (!column.known) column.target = log_.extra[column.extra].second.data();
    }
  }

  void read_rows() {
    const char* at = text_.data() + body_;
    const char* const end = text_.data() + text_.size();
    std::size_t line = 1;
    std::size_t blank_line = 0;  // first blank line of the run before this one
    double last_time = 0.0;
    while (at != end) {
      ++line;
      const char* const line_begin = at;
      if (skip_blank_line(at, end)) {
        if (blank_line == 0) blank_line = line;
        continue;
      }
      if (blank_line != 0) {
        fail(blank_line,
             "column 'time': found a blank line between rows; expected {} fields in every row; "
             "remove the blank line",
             columns_.size());
      }
      for (std::size_t c = 0; c < columns_.size(); ++c) {
        read_field(at, end, line, line_begin, c);
      }
      if (at != end && *at == ',') fail_ragged(line, line_begin, end);
      if (at != end && *at == '\r') ++at;
      if (at != end) ++at;  // past the line feed

      const double time = log_.time[num_rows_];
      if (num_rows_ > 0 && !(time > last_time)) {
        fail(line,
             "column 'time': found {} after {} (line {}); expected time to increase with every row; "
             "remove repeated rows or sort the log",
             time, last_time, line - 1);
      }
      last_time = time;
      ++num_rows_;
    }
    last_line_ = static_cast<std::size_t>(num_rows_) + 1;
  }

  static bool skip_blank_line(const char*& at, const char* end) {
    const char* look = at;
    while (look != end && (is_space(*look) || *look == '\r')) ++look;
    if (look != end && *look != '\n') return false;
    at = (look == end) ? end : look + 1;
    return true;
  }

  void read_field(const char*& at, const char* end, std::size_t line, const char* line_begin,
                  std::size_t index) {
    Column& column = columns_[index];
    if (index > 0) {
      if (at == end || *at != ',') fail_ragged(line, line_begin, end);
      ++at;
    }
    if (column.target == nullptr) {
      while (at != end && *at != ',' && *at != '\n') ++at;
      return;
    }
    const char* const begin = at;
    double value = 0.0;
    const FieldProblem problem = read_number(at, end, value);
    if (problem == FieldProblem::kNone) [[likely]] {
      column.target[num_rows_] = value;
      return;
    }
    const std::string_view field = field_around(begin, end);
    if (!column.known) {
      // A number is due only in the columns of the contract: the others are let go at the first text.
      dropped_.push_back(fmt::format("{} ('{}' in line {})", column.name, shown(field), line));
      log_.extra[column.extra].first.clear();
      column.target = nullptr;
      at = begin;
      while (at != end && *at != ',' && *at != '\n') ++at;
      return;
    }
    switch (problem) {
      case FieldProblem::kEmpty:
        // A short row may end in the middle of the numbers: say that rather than "empty field".
        if (count_fields(line_begin, end) != columns_.size()) fail_ragged(line, line_begin, end);
        fail(line, "column '{}': found an empty field; expected a number; fill it or remove the row",
             column.name);
      case FieldProblem::kNotFinite:
        fail(line, "column '{}': found '{}'; expected a finite number; remove the row or repair the value",
             column.name, shown(field));
      case FieldProblem::kTooLarge:
        fail(line, "column '{}': found '{}', which is too large; expected a finite number in SI units",
             column.name, shown(field));
      case FieldProblem::kText:
      case FieldProblem::kNone: break;
    }
    fail(line,
         "column '{}': found '{}'; expected a number (decimal point, no unit); correct or remove the row",
         column.name, shown(field));
  }

  static std::size_t count_fields(const char* line_begin, const char* end) {
    const char* stop = std::find(line_begin, end, '\n');
    return static_cast<std::size_t>(std::count(line_begin, stop, ',')) + 1;
  }

  [[noreturn]] void fail_ragged(std::size_t line, const char* line_begin, const char* end) const {
    const std::size_t found = count_fields(line_begin, end);
    if (found < columns_.size()) {
      fail(
          line,
          "column '{}' is missing: found {} fields; expected {} as in the header; complete or remove the row",
          columns_[found].name, found, columns_.size());
    }
    fail(line,
         "column '{}' is followed by more fields: found {}; expected {} as in the header; "
         "remove the surplus (a decimal comma also looks like this)",
         columns_.back().name, found, columns_.size());
  }

  void check_length() {
    const int least = std::max(needs_.min_samples, 1);
    if (num_rows_ < least) {
      fail(last_line_,
           "column 'time': the log ends after {} samples; expected at least {}; give a longer log", num_rows_,
           least);
    }
    if (num_rows_ == capacity_) return;
    log_.time.conservativeResize(num_rows_);
    for (const Channel& channel : kChannels) {
      Eigen::MatrixXd& matrix = log_.*channel.matrix;
      if (matrix.cols() > 0) matrix.conservativeResize(num_rows_, Eigen::NoChange);
    }
    for (auto& [name, values] : log_.extra) values.conservativeResize(num_rows_);
  }

  void apply_torque_constant() {
    if (!use_current_) return;
    log_.tau = log_.current;
    const std::vector<double>& constant = needs_.torque_constant;
    for (int joint = 0; joint < num_joints_; ++joint) {
      log_.tau.col(joint) *= constant.size() == 1 ? constant[0] : constant[static_cast<std::size_t>(joint)];
    }
  }

  void write_note(std::vector<std::string>& notes) const {
    std::string kept;
    for (const auto& [name, values] : log_.extra) kept += fmt::format("{}{}", kept.empty() ? "" : ", ", name);
    if (kept.empty() && dropped_.empty()) return;
    std::string note = fmt::format("{}: ", path_);
    if (!kept.empty()) note += fmt::format("columns carried along without use: {}", kept);
    if (!dropped_.empty()) {
      note += fmt::format("{}columns ignored because they do not hold numbers only: {}",
                          kept.empty() ? "" : "; ", fmt::join(dropped_, ", "));
    }
    notes.push_back(note);
  }

  const std::string& path_;
  const LogRequirements& needs_;
  std::string text_;
  std::size_t body_{0};  ///< where the rows begin in text_
  std::vector<Column> columns_;
  std::vector<bool> complete_;  ///< for each of kChannels
  int num_joints_{0};
  bool use_current_{false};
  Eigen::Index capacity_{0};
  Eigen::Index num_rows_{0};
  std::size_t last_line_{1};
  std::vector<std::string> dropped_;
  Log log_;
};

/// The columns of a log in the order they are written.
std::vector<std::pair<std::string, const double*>> columns_of(const Log& log) {
  const Eigen::Index rows = log.time.size();
  const auto check = [&](Eigen::Index found, const std::string& what) {
    if (found != rows) {
      throw Error(fmt::format("log to be written: {} has {} rows, time has {}; expected the same number",
                              what, found, rows));
    }
  };
  std::vector<std::pair<std::string, const double*>> columns{{"time", log.time.data()}};
  for (const Channel& channel : kChannels) {
    const Eigen::MatrixXd& matrix = log.*channel.matrix;
    if (matrix.cols() == 0) continue;
    check(matrix.rows(), std::string(channel.prefix));
    for (Eigen::Index joint = 0; joint < matrix.cols(); ++joint) {
      columns.emplace_back(fmt::format("{}{}", channel.prefix, joint + 1), matrix.col(joint).data());
    }
  }
  for (const auto& [name, values] : log.extra) {
    check(values.size(), name);
    columns.emplace_back(name, values.data());
  }
  return columns;
}

}  // namespace

Log read_log(const std::string& path, const LogRequirements& needs, std::vector<std::string>* notes) {
  return LogReader(path, needs).read(notes);
}

std::string to_csv(const Log& log) {
  const auto columns = columns_of(log);
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  for (std::size_t c = 0; c < columns.size(); ++c)
    fmt::format_to(out, "{}{}", c == 0 ? "" : ",", columns[c].first);
  text.push_back('\n');
  std::array<char, 40> number{};
  for (Eigen::Index row = 0; row < log.time.size(); ++row) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (c > 0) text.push_back(',');
      // Shortest text that reads back to the same double.
      const char* stop =
          std::to_chars(number.data(), number.data() + number.size(), columns[c].second[row]).ptr;
      text.append(number.data(), stop);
    }
    text.push_back('\n');
  }
  return fmt::to_string(text);
}

void write_log(const std::string& path, const Log& log) { host::write_file_atomically(path, to_csv(log)); }

}  // namespace heft::data
