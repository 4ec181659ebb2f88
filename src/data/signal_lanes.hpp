/// @file
/// What filters do to every signal alike, in the widest lanes that the processor has. Products and sums stay apart: the same
/// bits on every processor.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace heft::data {

class LowPass;

/// Over a stretch of rows between two kept ones; 4 × 4 matrices row by row. Derivation: src/data/decimate.md
struct StretchFilter {
  static constexpr int kStates = 4;
  const double* A;  ///< 4 × 4: of states from one end to the other
  const double* H;  ///< 4 × 4: of the forward states in front of it, in the backward ones
  const double* e;  ///< 4: of the same, in the forward output in its last row
  const double* C;  ///< 4: of the states, in an output
  double D;         ///< of the input, in an output
};

struct SignalLanes {
  /// So many signals and more as fill vectors.
  Eigen::Index padded(Eigen::Index signals) const { return (signals + width - 1) / width * width; }

  Eigen::Index width;  ///< signals in a vector
  Eigen::Index most;   ///< signals that `filter` takes at once: what the registers hold
  /// One direction of the low-pass in place.
  /// @param first     of the first signal: `rows` numbers one behind the other
  /// @param step      from signal to signal
  /// @param signals   a multiple of `width`, at most `most`
  /// @param backward  from the last row to the first
  /// @param states    4 rows of `signals` numbers, each `state_step` behind the last: s1 and s2 of the first section, then of the
  ///                  second; those that it begins with become those behind its last row. Null: it begins at rest on its first value
  void (*filter)(const LowPass& low_pass, double* first, Eigen::Index rows, Eigen::Index step, Eigen::Index signals,
                 bool backward, double* states, Eigen::Index state_step);

  // Of signals side by side in a row, their number even.

  /// What a stretch adds up to: forward states, backward states, forward output.
  static constexpr int kSums = 2 * StretchFilter::kStates + 1;
  /// Columns as rows of `signals` numbers.
  /// @param columns  `signals` of them, `rows` numbers each
  void (*side_by_side)(const double* const* columns, double* to, Eigen::Index signals, Eigen::Index rows);
  /// Adds rows times their factors, kSums a row, to `sums`, kSums rows of `signals` numbers.
  void (*add)(double* sums, const double* rows, const double* factors, Eigen::Index signals, Eigen::Index count);
  /// The end of a stretch: its sums become zero.
  /// @param forward  kStates rows: forward states in front of the stretch, then behind it
  /// @param output   one row: the forward output
  /// @param behind   kStates rows: what the stretch adds to the backward states
  void (*end)(const StretchFilter& filter, double* sums, double* forward, double* output, double* behind,
              Eigen::Index signals);
  /// One kept row of the backward run.
  /// @param output    one row: the forward output, then that of both
  /// @param behind    kStates rows of the stretch in front of it; null: there is none
  /// @param backward  kStates rows: states behind the row, then behind the kept row before
  void (*back)(const StretchFilter& filter, double* output, const double* behind, double* backward, Eigen::Index signals);
};

/// Those that this processor has, narrowest first.
std::vector<const SignalLanes*> available_signal_lanes();
/// The widest of them.
const SignalLanes& signal_lanes();

}  // namespace heft::data
