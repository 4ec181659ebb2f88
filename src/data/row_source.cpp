#include "row_source.hpp"

#include <algorithm>

namespace heft::data {

using Eigen::Index;

void RowBuffer::make_room(Index rows) {
  if (end + rows <= time.size()) return;
  const Index used = size();
  if (used + rows > time.size() - time.size() / 4) {
    const Index capacity = 2 * (used + rows);
    Eigen::VectorXd new_time(capacity);
    Eigen::MatrixXd new_values(capacity, values.cols());
    new_time.head(used) = time.segment(begin, used);
    new_values.topRows(used) = values.middleRows(begin, used);
    time = std::move(new_time);
    values = std::move(new_values);
  } else {
    // Towards the front, so that an overlap is copied in the right order.
    std::copy(time.data() + begin, time.data() + end, time.data());
    for (Index c = 0; c < values.cols(); ++c) {
      double* column = values.col(c).data();
      std::copy(column + begin, column + end, column);
    }
  }
  begin = 0;
  end = used;
}

Index MemorySource::read(Index most, RowBuffer& rows) {
  const Index count = std::min(most, time_.size() - at_);
  rows.make_room(count);
  rows.time.segment(rows.end, count) = time_.segment(at_, count);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    rows.values.col(static_cast<Index>(c)).segment(rows.end, count) =
        Eigen::Map<const Eigen::VectorXd>(columns_[c] + at_, count);
  }
  rows.end += count;
  at_ += count;
  return count;
}

Index FileSource::read(Index most, RowBuffer& rows) {
  rows.make_room(most);
  const std::size_t time_column = file_.find_column("time");
  for (Index count = 0; count < most; ++count) {
    if (!file_.next(row_.data())) return count;
    rows.time[rows.end] = row_[time_column];
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      rows.values(rows.end, static_cast<Index>(c)) = columns_[c].factor * row_[columns_[c].column];
    }
    ++rows.end;
  }
  return most;
}

}  // namespace heft::data
