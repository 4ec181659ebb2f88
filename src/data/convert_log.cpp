#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>

#include <fmt/format.h>

#include "column_words.hpp"
#include "heft/data/describe_log.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file_writer.hpp"
#include "log_file.hpp"
#include "signal_file.hpp"

namespace heft::data {
namespace {

/// Part of the rows that files of one recording may differ by: what was not yet written when it was stopped.
constexpr double kTail = 0.01;
/// Rows in front that may lack a partner: recorders do not start at once.
constexpr double kFirst = 10.0;
/// Bytes of text that are written at once.
constexpr std::size_t kTextBlock = std::size_t{1} << 18;

/// A column of the output: of which file, at which place.
struct OutputColumn {
  std::string name;
  std::size_t file, column;
};

/// Logs read side by side.
class JoinedLogs {
 public:
  JoinedLogs(const std::vector<std::string>& paths, const ReadAs& as) {
    for (const std::string& path : paths) {
      files_.push_back(std::make_unique<SignalFile>(path, as));
      files_.back()->require_known();
    }
    if (!files_.front()->has_time()) {
      throw DataError(fmt::format(
          "{}: column 'time' is missing; expected one, or the rate of the rows; give it with --map "
          "time=500Hz",
          paths.front()));
    }
    for (const auto& file : files_) {
      if (file->has_time()) continue;
      throw DataError(fmt::format(
          "{}: column 'time' is missing though {} has one; expected time in all logs that are joined; "
          "add it, or say which column it is with --map time=COLUMN",
          file->path(), paths.front()));
    }
  }

  /// The next row for which every log has one. @return false at the end of one of them
  bool next() {
    for (;;) {
      SignalFile& first = *files_.front();
      const double last = first.rows() > 0 ? first.time() : 0.0;
      if (!first.next()) return false;
      if (first.rows() > 1) period_ = first.time() - last;
      if (first.rows() > 1 && !(period_ > 0.0)) {
        throw DataError(fmt::format(
            "{}: column 'time': found {} after {}; expected time to increase with every row; remove "
            "repeated rows or sort the log",
            first.reader().place(), first.time(), last));
      }
      bool all = true;
      for (std::size_t f = 1; f < files_.size(); ++f) {
        if (!catch_up(f, first.time())) return false;
        const double step = std::abs(files_[f]->time() - first.time());
        // The first row has no period yet: its partner has the same stamp, or the row is left out.
        all = all && step <= 0.5 * period_;
        if (all) largest_step_ = std::max(largest_step_, step);
      }
      if (all) return true;
      ++left_out_;
    }
  }

  double value(const OutputColumn& column) const {
    const SignalFile& file = *files_[column.file];
    return file.is_dropped(column.column) ? std::nan("") : file.values()[column.column];
  }
  const std::vector<std::unique_ptr<SignalFile>>& files() const { return files_; }
  long left_out() const { return left_out_; }
  double largest_step() const { return largest_step_; }

 private:
  /// Moves a log to its row nearest to `time` from below, or on it.
  bool catch_up(std::size_t f, double time) {
    SignalFile& file = *files_[f];
    while (file.rows() == 0 || file.time() < time - 0.5 * period_) {
      if (!file.next()) return false;
    }
    return true;
  }

  std::vector<std::unique_ptr<SignalFile>> files_;
  double period_{0.0}, largest_step_{0.0};
  long left_out_{0};
};

/// Channels in heft's order, then the others, time in front.
std::vector<OutputColumn> output_columns(const JoinedLogs& logs) {
  std::map<std::string, std::size_t> seen;
  std::vector<OutputColumn> columns;
  for (std::size_t f = 0; f < logs.files().size(); ++f) {
    const SignalFile& file = *logs.files()[f];
    for (std::size_t c = 0; c < file.columns().size(); ++c) {
      const std::string& name = file.columns()[c].name;
      if (name == kNanosecondsPart || file.is_dropped(c) || (f > 0 && c == file.time_column())) continue;
      const auto [before, is_new] = seen.emplace(name, f);
      if (is_new) {
        columns.push_back({name, f, c});
      } else if (file.is_known(c)) {
        throw DataError(fmt::format(
            "{}: column '{}' is in {} too; expected every column in one of the logs that are joined; "
            "leave one out, or rename it with --map",
            file.path(), name, logs.files()[before->second]->path()));
      }
    }
  }
  const auto rank = [](const OutputColumn& column) {
    if (column.name == "time") return std::pair<std::size_t, int>(0, 0);
    std::size_t group = 1;
    for (const Channel& channel : kChannels) {
      if (const int joint = joint_number(column.name, channel.prefix); joint > 0)
        return std::pair(group, joint);
      ++group;
    }
    return std::pair(group, 0);
  };
  std::stable_sort(columns.begin(), columns.end(),
                   [&](const OutputColumn& a, const OutputColumn& b) { return rank(a) < rank(b); });
  const bool any = std::any_of(columns.begin(), columns.end(),
                               [](const auto& column) { return joint_of(column.name) > 0; });
  if (!any) {
    throw DataError(fmt::format(
        "{}: no column of a joint was recognised; expected positions, torques or others; say which "
        "they are with --map q=NAME,tau=NAME",
        logs.files().front()->path()));
  }
  return columns;
}

/// A field that a comma or quote would break.
std::string quoted(const std::string& name) {
  return name.find_first_of(",\"") == std::string::npos ? name : fmt::format("\"{}\"", name);
}

void refuse_what_does_not_belong(const JoinedLogs& logs, long rows) {
  const SignalFile& first = *logs.files().front();
  if (logs.files().size() == 1) {
    if (rows == 0)
      throw DataError(fmt::format("{}: the log has no rows; expected one or more", first.path()));
    return;
  }
  if (rows < 2) {
    throw DataError(fmt::format(
        "{}: {} rows of {} have a partner in every other log; expected stamps of one clock; nothing was "
        "written",
        first.path(), rows, first.rows()));
  }
  if (static_cast<double>(logs.left_out()) > std::max(kFirst, kTail * static_cast<double>(first.rows()))) {
    throw DataError(fmt::format(
        "{}: {} of {} rows have no partner in the other logs within half a period; expected stamps of one "
        "clock; nothing was written",
        first.path(), logs.left_out(), first.rows()));
  }
}

}  // namespace

LogConversion convert_logs(const std::vector<std::string>& paths, const ReadAs& as,
                           const std::string& output) {
  JoinedLogs logs(paths, as);
  host::FileWriter out(output);
  LogConversion conversion;
  fmt::memory_buffer text;
  std::vector<OutputColumn> columns;
  std::array<char, 40> number{};
  while (logs.next()) {
    if (conversion.rows++ == 0) {  // columns that hold text are known with the first row
      columns = output_columns(logs);
      for (std::size_t c = 0; c < columns.size(); ++c)
        fmt::format_to(std::back_inserter(text), "{}{}", c == 0 ? "" : ",", quoted(columns[c].name));
      text.push_back('\n');
    }
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (c > 0) text.push_back(',');
      // Shortest text that reads back to the same double.
      const char* stop =
          std::to_chars(number.data(), number.data() + number.size(), logs.value(columns[c])).ptr;
      text.append(number.data(), stop);
    }
    text.push_back('\n');
    if (text.size() > kTextBlock) {
      out.write({text.data(), text.size()});
      text.clear();
    }
  }
  refuse_what_does_not_belong(logs, conversion.rows);
  out.write({text.data(), text.size()});
  out.finish();
  conversion.left_out = logs.left_out();
  conversion.largest_step = logs.largest_step();
  for (const auto& file : logs.files()) {
    for (const std::string& note : file->notes())
      conversion.notes.push_back(fmt::format("{}: {}", file->path(), note));
  }
  return conversion;
}

}  // namespace heft::data
