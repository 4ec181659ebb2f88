/// @file
/// Rows of a regression kept beside memory, so that who needs them once more need not read the logs again.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "heft/host/number_store.hpp"
#include "heft/regression/observations.hpp"

namespace heft::regression {

/// Rows in the order in which for_each_observation() gave them. In a temporary file where they are many: memory does not grow
/// with the logs.
class RecordedRows {
 public:
  void add(const ObservationRows& rows);
  /// false: the disk did not take them, and the logs have to be read again.
  bool is_usable() const { return numbers_.is_usable(); }

  /// Reads them from front to back.
  class Pass {
   public:
    /// @param joint  whose rows alone are read; -1: all
    explicit Pass(const RecordedRows& rows, int joint = -1) : rows_(rows), joint_(joint) {}
    /// The next rows, without instruments.
    /// @return false at the end
    /// @throws DataError when the disk does not give back what was written
    bool next(ObservationRows& rows);

   private:
    const RecordedRows& rows_;
    int joint_;
    std::size_t piece_{0}, at_{0};
  };

 private:
  struct Piece {
    int log, joint;
    Eigen::Index rows, columns;
    std::vector<int> filled;  ///< columns that hold anything but zeros
  };
  std::vector<Piece> pieces_;
  host::NumberStore numbers_;  ///< of each piece: time, torque, then the filled columns
};

}  // namespace heft::regression
