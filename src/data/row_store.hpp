/// @file
/// Rows of a log kept as numbers, so that no later pass reads text again.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/host/number_store.hpp"
#include "row_source.hpp"

namespace heft::data {

/// Time and a choice of columns, in blocks of kBlockRows rows, column by column within one: what a pass does not need it
/// does not read. In a temporary file where they are many.
class RowStore {
 public:
  explicit RowStore(std::size_t columns) : block_(1 + columns) {}

  /// A block: kBlockRows rows, fewer only in the last one.
  void add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& values);
  /// false: the disk did not take them.
  bool is_usable() const { return numbers_.is_usable(); }
  Eigen::Index rows() const { return rows_; }
  /// Reads rows of one block. `column` -1: time.
  /// @return whether they could be read
  bool read(Eigen::Index first, int column, Eigen::Index count, double* to) const;

 private:
  std::size_t block_;  ///< columns, time included
  Eigen::Index rows_{0};
  host::NumberStore numbers_;
};

/// A pass over the rows of a store.
class StoreSource : public RowSource {
 public:
  /// @param columns  of the store
  StoreSource(const RowStore& store, std::vector<int> columns) : store_(store), columns_(std::move(columns)) {}
  /// @throws DataError when the disk does not give back what was written
  Eigen::Index read(Eigen::Index most, RowBuffer& rows) override;

 private:
  const RowStore& store_;
  std::vector<int> columns_;
  Eigen::Index at_{0};
};

}  // namespace heft::data
