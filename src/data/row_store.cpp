#include "row_store.hpp"

#include <algorithm>

#include "heft/host/error.hpp"

namespace heft::data {

using Eigen::Index;

void RowStore::add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& values) {
  rows_ += time.size();
  numbers_.append({time.data(), static_cast<std::size_t>(time.size())});
  for (Index c = 0; c < values.cols(); ++c)
    numbers_.append({values.col(c).data(), static_cast<std::size_t>(values.rows())});
}

bool RowStore::read(Index first, int column, Index count, double* to) const {
  const Index block = first / kBlockRows;
  const Index in_block = std::min(kBlockRows, rows_ - block * kBlockRows);
  const Index place = block * kBlockRows * static_cast<Index>(block_) + (column + 1) * in_block + first % kBlockRows;
  return numbers_.read(static_cast<std::size_t>(place), {to, static_cast<std::size_t>(count)});
}

Index StoreSource::read(Index most, RowBuffer& rows) {
  const Index count = std::min({most, store_.rows() - at_, kBlockRows - at_ % kBlockRows});
  if (count == 0) return 0;
  rows.make_room(count);
  bool read = store_.read(at_, -1, count, rows.time.data() + rows.end);
  for (std::size_t c = 0; c < columns_.size() && read; ++c)
    read = store_.read(at_, columns_[c], count, rows.values.col(static_cast<Index>(c)).data() + rows.end);
  if (!read) throw DataError("a temporary file of the rows of a log cannot be read; check the disk of TMPDIR");
  rows.end += count;
  at_ += count;
  return count;
}

}  // namespace heft::data
