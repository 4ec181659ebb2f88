#include "signal_file.hpp"

#include <algorithm>

#include <fmt/ranges.h>

#include "column_words.hpp"
#include "open_log.hpp"

namespace heft::data {

int joint_of(const std::string& column) {
  for (const ColumnGroup& group : column_groups()) {
    if (group.quantity == Quantity::kTime) continue;
    if (const int joint = joint_number(column, group.name); joint > 0) return joint;
  }
  return 0;
}

SignalFile::SignalFile(const std::string& path, const ReadAs& as)
    : path_(path), reader_(open_log(path, as)), text_(dynamic_cast<TextReader*>(reader_.get())) {
  columns_ = reader_->columns();
  const auto time = std::find_if(columns_.begin(), columns_.end(),
                                 [](const LogColumn& column) { return column.name == "time"; });
  time_ = static_cast<std::size_t>(time - columns_.begin());
  if (!has_time()) {
    rate_ = given_rate(as, path);
    if (rate_ > 0.0) columns_.push_back({"time", ""});
  }
  values_.resize(columns_.size());
}

bool SignalFile::is_known(std::size_t column) const {
  return column == time_ || joint_of(columns_[column].name) > 0;
}

void SignalFile::require_known() {
  for (std::size_t c = 0; text_ != nullptr && c < reader_->columns().size(); ++c) {
    if (is_known(c)) text_->require(c);
  }
}

bool SignalFile::next() {
  if (!reader_->next(values_.data())) return false;
  if (rate_ > 0.0) values_[time_] = static_cast<double>(rows_) / rate_;
  ++rows_;
  return true;
}

std::vector<std::string> SignalFile::notes() const {
  std::vector<std::string> notes = reader_->notes();
  if (text_ != nullptr && !text_->dropped().empty()) {
    notes.push_back(fmt::format("columns ignored because they do not hold numbers only: {}",
                                fmt::join(text_->dropped(), ", ")));
  }
  return notes;
}

}  // namespace heft::data
