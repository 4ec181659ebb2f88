#include "heft/data/log.hpp"

#include <array>
#include <charconv>
#include <iterator>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "log_file.hpp"

namespace heft::data {
namespace {

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

Log rows_of(LogFile& file, const std::string& path, std::vector<std::string>* notes) {
  const std::size_t num_columns = file.num_columns();
  const std::size_t time_column = file.find_column("time");
  std::vector<std::vector<double>> columns(num_columns);
  std::vector<FileColumn> all(num_columns);
  for (std::size_t c = 0; c < num_columns; ++c) all[c].column = c;
  all.erase(all.begin() + static_cast<std::ptrdiff_t>(time_column));
  file.for_each_rows(all, [&](const FileRows& read) {
    const auto append = [&](std::size_t column, const double* values) {
      columns[column].insert(columns[column].end(), values, values + read.time.size());
    };
    append(time_column, read.time.data());
    for (std::size_t c = 0; c < all.size(); ++c)
      append(all[c].column, read.values.col(static_cast<Eigen::Index>(c)).data());
  });
  file.check_length();

  Log log;
  log.path = path;
  const Eigen::Index rows = file.num_rows();
  // Moves a column out, so that the log is not in memory twice.
  const auto take = [&](std::size_t c) {
    const std::vector<double> values = std::move(columns[c]);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(values.data(), rows));
  };
  log.time = take(time_column);
  for (const Channel& channel : kChannels) {
    if (!file.has_channel(channel.matrix)) continue;
    Eigen::MatrixXd& matrix = log.*channel.matrix;
    matrix.resize(rows, file.num_joints());
    for (int joint = 0; joint < file.num_joints(); ++joint) {
      matrix.col(joint) = take(file.find_column(fmt::format("{}{}", channel.prefix, joint + 1)));
    }
  }
  for (std::size_t c = 0; c < num_columns; ++c) {
    if (!file.is_known(c) && !file.is_dropped(c)) log.extra.emplace_back(file.column_name(c), take(c));
  }
  if (file.torque_from_current()) {
    log.tau = log.current;
    for (int joint = 0; joint < file.num_joints(); ++joint) log.tau.col(joint) *= file.torque_constant(joint);
  }
  if (notes != nullptr) {
    if (std::string note = file.note(); !note.empty()) notes->push_back(std::move(note));
  }
  return log;
}

Log read_log(const std::string& path, const LogRequirements& needs, std::vector<std::string>* notes) {
  LogFile file(path, needs);
  Log log = rows_of(file, path, notes);
  if (std::string how = file.how_read(); notes != nullptr && !how.empty())
    notes->insert(notes->begin(), std::move(how));
  return log;
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
