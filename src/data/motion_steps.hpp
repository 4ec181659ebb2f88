/// @file
/// Steps that deriving motion from a whole log and from pieces of one have in common.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"

namespace heft::data {

/// Longest stretch without samples that a spline may bridge, in median periods.
inline constexpr double kGapFactor = 10.0;

/// `resample` with the longest bridged stretch given [s], so that a piece of a log has the gaps of the whole.
Eigen::MatrixXd resample(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal,
                         const Eigen::VectorXd& at, double longest);

/// Number of rows of the even grid over `length` seconds at about `sample_rate`.
Eigen::Index grid_rows(double length, double sample_rate);

/// The cut-off that `options` ask for, or the one chosen for this bandwidth; 0: no filter.
/// @throws DataError when it is negative or not below half the sample rate
double choose_cutoff(const std::string& path, const MotionOptions& options, double bandwidth,
                     double sample_rate);

/// The message for logs too short to derive anything from.
[[noreturn]] void refuse_short_log(const std::string& path, long samples);

/// Fewest samples that velocity and acceleration are derived from.
inline constexpr int kLeastSamples = 5;

/// Smoothed position, velocity and acceleration on an even grid.
struct DerivedMotion {
  Eigen::MatrixXd q, qd, qdd;
};
DerivedMotion derive_on_grid(const Eigen::VectorXd& grid, const Eigen::MatrixXd& q, double sample_rate,
                             double cutoff, const MotionOptions& options);

/// Rows at the edge of a piece that differ from those of the whole log by more than 1e-12.
Eigen::Index settling_rows(double sample_rate, double cutoff, const MotionOptions& options);

/// `motion_bandwidth` of a log of any length in bounded memory: exact up to kWhole rows; beyond, from the
/// mean of the periodograms of half-overlapping stretches of kWhole rows (Welch), about the mean of the whole
/// log.
class BandwidthEstimate {
 public:
  static constexpr Eigen::Index kWhole = Eigen::Index{1} << 17;

  /// @param rows         of the grid in all
  /// @param mean         of each joint over the log
  BandwidthEstimate(Eigen::Index rows, Eigen::RowVectorXd mean, double sample_rate);
  /// The next rows, rows × n.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q);
  /// [Hz], after the last row.
  double value();

 private:
  void add_stretch();

  Eigen::RowVectorXd mean_;
  double sample_rate_;
  Eigen::MatrixXd stretch_;  ///< rows not yet used up, kWhole at most
  Eigen::Index filled_{0};
  Eigen::Index fresh_{0};  ///< of them, not in any periodogram yet
  Eigen::Index total_rows_{0};
  Eigen::RowVectorXd square_sum_;  ///< of the deviation from mean_
  Eigen::MatrixXd power_;          ///< frequencies × n
};

/// The middle one (number size/2 in ascending order) of any number of positive values, exactly, in bounded
/// memory. Many values are to be fed more than once: bit by bit of their binary form the range in which the
/// middle lies is narrowed down.
class StreamingMedian {
 public:
  void add(double value);
  /// After all values: true when value() is known, false when they are to be fed once more.
  bool finish_pass();
  double value() const { return value_; }

 private:
  static constexpr std::size_t kMost = std::size_t{1} << 17;
  static constexpr int kBits = 16;  ///< resolved in one pass

  void count(double value);

  std::vector<double> values_;         ///< all of them, or those in the range
  std::vector<std::uint64_t> counts_;  ///< of the kBits after the known ones; empty: collecting
  std::uint64_t known_{0};             ///< leading bits of the middle one
  int known_bits_{0};
  std::uint64_t rank_{0};   ///< of the middle one among those in the range
  std::uint64_t total_{0};  ///< in the first pass
  bool first_pass_{true};
  double value_{0.0};
};

}  // namespace heft::data
