/// @file
/// From logs to rows of a regression: regressor and torque through the same filter.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::regression {

struct ObservationOptions {
  /// Low-pass on torque and on every column [Hz]; 0: the cut-off that the motion stream uses.
  double cutoff{0.0};
  /// Rows kept a second, in cut-offs: behind the low-pass, rows that follow faster say nothing new.
  double rows_per_cutoff{4.0};
  /// Rows in which the joint was slower than this within the filter's reach are left out [rad/s, m/s]. 0 keeps them. With Coulomb
  /// friction among the columns, rests are left out anyway (rests.hpp): friction takes up any torque below its level there.
  double standstill_speed{0.0};
};

/// Rows of one joint from one piece of a log.
struct ObservationRows {
  int log{0};
  int joint{0};
  Eigen::VectorXd time;  ///< m [s]
  Eigen::MatrixXd W;     ///< m × selected columns
  Eigen::VectorXd tau;   ///< m [N·m, N]
  Eigen::MatrixXd Z;     ///< instruments, like W, where a motion for them was given; else 0 columns
};

class RecordedRows;

/// Rows of a piece's grid that become rows of the regression: first, first + step, ...
struct KeptRows {
  Eigen::Index first{0}, step{1};
};

/// A motion on rows first, first + stride, ... of a piece's grid.
struct ThinnedMotion {
  Eigen::Index first{0}, stride{1};
  Eigen::MatrixXd q, qd, qdd;  ///< m × n each
};

/// Makes another motion along a piece of log, for instruments. The kept rows must be among its own: its stride divides their
/// step. Its regressor passes the same low-pass at its own rate. Called for several pieces at once, on several threads.
using InstrumentMotion = std::function<ThinnedMotion(int log, const data::MotionChunk& chunk, const KeptRows& kept)>;

/// Calls `rows` for every piece of every log and every joint, in time order, one call at a time. Pieces are worked on by all
/// threads; what comes out does not depend on their number.
///
/// The columns are built at the even grid's own rate from zero-phase filtered motion, then torque and columns
/// pass the same zero-phase low-pass and every k-th row is kept. Coulomb columns are built with the sharp sign
/// and filtered like the rest; a smoothed sign together with an unfiltered torque would hide half of the error at
/// reversals. Memory: one piece of log.
///
/// @param selected  columns of the regression wanted, ascending; empty: all
/// @param recorded  with instruments: what add() of these rows was called with in a pass before, with the same logs and options;
///                  W and torque are taken from there. May be null
void for_each_observation(const RegressionColumns& columns, const std::vector<int>& selected,
                          const std::vector<const data::MotionStream*>& logs,
                          const ObservationOptions& options,
                          const std::function<void(const ObservationRows&)>& rows,
                          const InstrumentMotion& instruments = {}, const RecordedRows* recorded = nullptr);

}  // namespace heft::regression
