/// @file
/// When the rows of a log were taken: times beside the stamps, found in one pass over the positions.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include <Eigen/Core>

#include "heft/host/number_store.hpp"
#include "log_facts.hpp"
#include "row_source.hpp"
#include "sample_times.hpp"

namespace heft::data {

/// What the positions say about the stamps of a log, and where its samples are placed. Memory does not grow with the log.
class RowTimes {
 public:
  /// A new pass over the rows: time alone, or with the positions.
  using Open = std::function<std::unique_ptr<RowSource>(bool positions)>;

  /// Three passes or more, if the stamps are uneven; none otherwise.
  /// @param stamps  of all rows
  /// @throws DataError as the passes do
  RowTimes(const SampleClock& stamps, const Open& open, Eigen::Index joints);

  const StampScatter& scatter() const { return scatter_; }
  /// false: nowhere to keep the times; stamps are used as they are.
  bool has_room() const { return has_room_; }
  /// The clock of the placed samples.
  const SampleClock& clock() const { return clock_; }
  /// Replaces stamps by times of samples, where samples are placed.
  /// @param first  row of the first of them; rows that the log did not have keep their stamps
  void place(Eigen::Index first, Eigen::Ref<Eigen::VectorXd> time) const;

 private:
  StampScatter scatter_;
  host::NumberStore even_;  ///< when the even clock beat at each row [s]
  bool has_room_{true};
  SampleClock clock_;
};

/// A pass that hands out when samples were taken instead of their stamps.
class PlacedSource : public RowSource {
 public:
  PlacedSource(std::unique_ptr<RowSource> stamped, const RowTimes& times)
      : stamped_(std::move(stamped)), times_(times) {}
  Eigen::Index read(Eigen::Index most, RowBuffer& rows) override;

 private:
  std::unique_ptr<RowSource> stamped_;
  const RowTimes& times_;
  Eigen::Index at_{0};
};

}  // namespace heft::data
