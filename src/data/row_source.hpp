/// @file
/// Where a pass over a log gets its rows from, in memory or from a file.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "log_file.hpp"

namespace heft::data {

/// Rows of a log read at once.
inline constexpr Eigen::Index kBlockRows = 2048;

/// Rows of a log in a row, old ones dropped in front and new ones added behind.
struct RowBuffer {
  Eigen::VectorXd time;
  Eigen::MatrixXd values;
  Eigen::Index begin{0}, end{0};  ///< rows in use
  Eigen::Index first{0};          ///< number of row `begin`, counted from the start of the log

  explicit RowBuffer(Eigen::Index columns) : time(4 * kBlockRows), values(4 * kBlockRows, columns) {}

  Eigen::Index size() const { return end - begin; }
  /// Makes the buffer hold `rows` more behind `end`.
  void make_room(Eigen::Index rows);
  void drop_front(Eigen::Index rows) {
    begin += rows;
    first += rows;
  }
  void clear() { drop_front(size()); }
};

/// Where a pass over a log gets its rows from: time and a choice of columns.
class RowSource {
 public:
  virtual ~RowSource() = default;
  /// Adds up to `most` rows. @return how many; 0 at the end
  virtual Eigen::Index read(Eigen::Index most, RowBuffer& rows) = 0;
};

/// Calls `use` with the time of each row that is left of a pass.
template <typename Use>
void for_each_time(RowSource& pass, const Use& use) {
  RowBuffer rows(0);
  while (pass.read(kBlockRows, rows) > 0) {
    for (Eigen::Index k = rows.begin; k < rows.end; ++k) use(rows.time[k]);
    rows.clear();
  }
}

class MemorySource : public RowSource {
 public:
  MemorySource(const Eigen::VectorXd& time, std::vector<const double*> columns)
      : time_(time), columns_(std::move(columns)) {}

  Eigen::Index read(Eigen::Index most, RowBuffer& rows) override;

 private:
  const Eigen::VectorXd& time_;
  std::vector<const double*> columns_;
  Eigen::Index at_{0};
};

class FileSource : public RowSource {
 public:
  FileSource(LogFile& file, std::vector<FileColumn> columns)
      : file_(file), columns_(std::move(columns)), row_(file.num_columns(), 0.0) {}

  Eigen::Index read(Eigen::Index most, RowBuffer& rows) override;

 private:
  LogFile& file_;
  std::vector<FileColumn> columns_;
  std::vector<double> row_;
};

}  // namespace heft::data
