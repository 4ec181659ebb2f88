/// @file
/// Scales of free motion and the multiple of them that makes a threshold. Derivation: thresholds.md.
#pragma once

#include <vector>

#include "balance.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

/// Length of a block [s]: five time constants of the offsets, so that maxima of blocks hardly know of one another.
inline constexpr double kBlock = 1.0;

/// Thresholds that one in fifty half seconds of free motion exceeds: one scale a joint and phase, for residual and change,
/// with the speeds and the rate of the load that the logs show.
/// @param logs          at least one
/// @param least_speed   of a joint that moves, one a joint [rad/s, m/s]
Thresholds scales_of(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                     double bandwidth);

/// The largest multiples of the scales in each block of the logs.
struct BlockMaxima {
  std::vector<double> rest, motion;  ///< of the residual of any joint, at rest, and turning or moving
  std::vector<std::vector<double>> rest_change, motion_change;  ///< of the change of each joint
};
/// Each log is measured by the scales of the others: friction and motions differ more from one recording to the next than
/// within one. A single log is measured by its own.
BlockMaxima block_maxima(const std::vector<const Balance*>& logs, const Eigen::VectorXd& least_speed,
                         double bandwidth);

/// The tail of block maxima beyond `from`: generalised Pareto with the mean excess `mean_excess`.
struct Tail {
  double from{0.0}, mean_excess{0.0};
  double shape{0.0};  ///< within -0.25..0: what the model misses of friction is bounded
  long beyond{0}, blocks{0};

  /// Multiple of the scale that is exceeded at that rate a block.
  double level(double rate) const;
  /// Logarithm of the rate a block at which that multiple is exceeded if the tail is exponential, which is the most that a
  /// shape within the bounds allows, and its standard deviation.
  double log_rate(double level) const;
  double log_rate_std(double level) const;
};
Tail tail_of(std::vector<double> maxima);

}  // namespace heft::monitor
