/// @file
/// A zero-phase low-pass of which every k-th row is kept, without computing the others.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace heft::data {

struct StretchFilter;

/// Rows of `low_pass_zero_phase` of many signals, every `step`-th of them: the same values up to rounding, at half of
/// its operations, in products of small matrices instead of recursions, and in memory for the kept rows only.
/// Derivation: src/data/decimate.md
///
/// Rows are added in sequence, any number at a time; signals are side by side in a row.
class DecimatedLowPass {
 public:
  /// Kept rows × signals.
  using Kept = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// @param sample_rate, cutoff  [Hz], 0 < cutoff < sample_rate/2
  /// @param signals     numbers in a row, even
  /// @param rows        that will be added
  /// @param first_kept  number of the first row that is kept, below `step`
  DecimatedLowPass(double sample_rate, double cutoff, Eigen::Index signals, Eigen::Index rows, Eigen::Index first_kept,
                   Eigen::Index step);

  /// The next rows, one behind the other. Cost: 18 operations a number.
  void add(const double* rows, Eigen::Index count);
  /// The same of rows that lie as columns.
  /// @param columns  one a signal, `count` numbers each
  void add_columns(const double* const* columns, Eigen::Index count);
  /// After the last row: rows first_kept, first_kept + step, ...
  Kept finish();

  Eigen::Index num_kept() const { return kept_; }

 private:
  static constexpr int kStates = 4;
  /// What a stretch of rows between two kept ones adds up to: the states of the forward run behind it and of the backward
  /// run before it, and the forward output in its last row.
  static constexpr int kSums = 2 * kStates + 1;

  void make_tables();
  void accumulate(const double* rows, Eigen::Index count);
  StretchFilter over_stretch() const;
  void end_stretch();
  Eigen::MatrixXd columns_in_lanes(Eigen::Index rows) const;
  void run(Eigen::MatrixXd& x, Kept& states, bool backward) const;
  static Kept at_rest(const Eigen::RowVectorXd& values);
  void begin_at_head();
  Kept backward_state_behind_last() const;

  double sample_rate_, cutoff_;
  Eigen::Index signals_, rows_, first_kept_, step_, kept_, padding_;
  Eigen::Index added_{0};          ///< rows so far
  Eigen::Index in_stretch_{0};     ///< of them, in the stretch that has not ended
  Eigen::Index stretch_{0};        ///< kept row with which it ends
  Eigen::Index head_rows_, tail_first_;
  std::vector<double> table_;  ///< step × kSums: what a row adds
  // One filter: x⁺ = A x + B u, y = C x + D u.
  using Matrix = Eigen::Matrix<double, kStates, kStates, Eigen::RowMajor>;
  Matrix A_, A_step_, H_;
  Eigen::Vector4d B_;
  Eigen::RowVector4d C_, e_;
  double D_{0.0};
  std::vector<double> rows_of_columns_;  ///< add_columns(): room for them
  Kept head_, tail_;         ///< first and last rows as they came
  Kept sums_;                ///< kSums × signals, of the present stretch
  Kept forward_;             ///< kStates × signals: the forward run behind the last stretch that ended
  Kept output_;              ///< kept × signals: its output in the kept rows
  Kept behind_;              ///< kStates × signals a kept row: what the stretch that ends there adds to the backward run
};

}  // namespace heft::data
