/// @file
/// The cut-off of a low-pass, from the bandwidth of the motion.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"
#include "heft/statistics/spectrum.hpp"

namespace heft::data {

/// The cut-off that `options` ask for, or the one chosen for this bandwidth; 0: no filter.
/// @throws DataError when it is negative or not below half the sample rate
double choose_cutoff(const std::string& path, const MotionOptions& options, double bandwidth,
                     double sample_rate);

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
  std::vector<statistics::Periodogram> periodograms_;  ///< one a thread
};

}  // namespace heft::data
