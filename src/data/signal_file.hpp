/// @file
/// A log that need not have all that a log of an arm has: one to be described, or a part of one to be joined.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "log_reader.hpp"
#include "readers/text_reader.hpp"

namespace heft::data {

class SignalFile {
 public:
  SignalFile(const std::string& path, const ReadAs& as);

  const std::string& path() const { return path_; }
  const LogReader& reader() const { return *reader_; }
  /// Those of the file, and `time` behind them where ReadAs gives a rate instead.
  const std::vector<LogColumn>& columns() const { return columns_; }
  /// columns().size(): there is none.
  std::size_t time_column() const { return time_; }
  bool has_time() const { return time_ < columns_.size(); }
  /// Time, or a column of a group that heft has a name for.
  bool is_known(std::size_t column) const;
  /// Text was found in it.
  bool is_dropped(std::size_t column) const {
    return text_ != nullptr && column < reader_->columns().size() && text_->is_dropped(column);
  }
  /// Bad fields of known columns are errors from now on.
  void require_known();
  /// The next row is in values(). @return false at the end
  bool next();
  const std::vector<double>& values() const { return values_; }
  double time() const { return values_[time_]; }
  long rows() const { return rows_; }
  /// What is worth telling once all was read.
  std::vector<std::string> notes() const;

 private:
  std::string path_;
  std::unique_ptr<LogReader> reader_;
  TextReader* text_{nullptr};
  std::vector<LogColumn> columns_;
  std::vector<double> values_;
  std::size_t time_{0};
  double rate_{0.0};
  long rows_{0};
};

/// Joint of a column of a group heft has a name for, counted from 1; 0: none.
int joint_of(const std::string& column);

}  // namespace heft::data
