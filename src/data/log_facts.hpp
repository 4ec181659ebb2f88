/// @file
/// What a pass over all rows of a log collects, whatever is done with the log later.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "displacement.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/data/log_checks.hpp"
#include "log_fingerprint.hpp"
#include "moving_span.hpp"
#include "streaming_median.hpp"

namespace heft::data {

/// Extremes and mean of the columns of a log.
class Ranges {
 public:
  Ranges(Eigen::Index joints, Eigen::Index torques)
      : low_(Eigen::RowVectorXd::Constant(joints, std::numeric_limits<double>::infinity())),
        high_(-low_),
        sum_(Eigen::RowVectorXd::Zero(joints)),
        torque_(Eigen::RowVectorXd::Zero(torques)) {}

  /// The next rows; `tau` may be without columns.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q, const Eigen::Ref<const Eigen::MatrixXd>& tau) {
    if (origin_.size() == 0) origin_ = q.row(0);
    low_ = low_.cwiseMin(q.colwise().minCoeff());
    high_ = high_.cwiseMax(q.colwise().maxCoeff());
    sum_ += (q.rowwise() - origin_).colwise().sum();
    if (tau.cols() > 0) torque_ = torque_.cwiseMax(tau.cwiseAbs().colwise().maxCoeff());
  }
  Eigen::VectorXd travel() const { return (high_ - low_).transpose(); }
  Eigen::VectorXd max_torque() const { return torque_.transpose(); }
  Eigen::RowVectorXd mean(long samples) const { return origin_ + sum_ / static_cast<double>(samples); }

 private:
  Eigen::RowVectorXd low_, high_, sum_, torque_;
  Eigen::RowVectorXd origin_;  ///< first row: a large constant must not leave rounding noise in the sum
};

/// Time stamps of a log, in order: their median and longest period, and whether an even grid fits them.
class SampleClock {
 public:
  void add(double t) {
    if (samples_ == 0) {
      begin_ = t;
    } else {
      const double elapsed = t - begin_;
      const auto number = static_cast<double>(samples_);
      least_period_ = std::max(least_period_, elapsed / (number + 0.01));
      most_period_ = std::min(most_period_, elapsed / (number - 0.01));
      longest_period_ = std::max(longest_period_, t - last_time_);
      median.add(t - last_time_);
    }
    last_time_ = t;
    ++samples_;
  }
  long samples() const { return samples_; }
  double begin() const { return begin_; }
  double end() const { return last_time_; }
  double longest_period() const { return longest_period_; }
  /// Whether an even grid from the first to the last of them fits.
  bool is_even() const {
    const double period = (last_time_ - begin_) / static_cast<double>(samples_ - 1);
    return least_period_ <= period && period <= most_period_;
  }

  StreamingMedian median;  ///< of the periods

 private:
  long samples_{0};
  double begin_{0.0}, last_time_{0.0};
  double longest_period_{0.0};
  // The grid is the log's own when |t_k - t_0 - k p| <= p/100 for every k and p = (t_end - t_0)/(m-1), that
  // is when (t_k - t_0)/(k + 0.01) <= p <= (t_k - t_0)/(k - 0.01): bounds that need no second look at the
  // rows.
  double least_period_{0.0};
  double most_period_{std::numeric_limits<double>::infinity()};
};

/// The even grid of a log.
struct LogGrid {
  Eigen::Index rows{0};
  bool resampled{false};      ///< it is not the log's own
  double sample_rate{0.0};    ///< [Hz]
  double longest{0.0};        ///< a longer time between two rows is a gap [s]
  std::vector<TimeGap> gaps;  ///< at most the first 100
};

/// All of it.
struct LogFacts {
  /// @param speeds  how fast joints move is read from the logged velocities too
  LogFacts(const std::string& path, Eigen::Index joints, Eigen::Index torques, bool speeds)
      : ranges(joints, torques),
        noise(joints),
        check(path, static_cast<int>(joints)),
        spans(speeds ? static_cast<std::size_t>(joints) : 0) {}

  /// The next rows; those of one call are compared with one another. What the log does not have is without columns.
  void add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
           const Eigen::Ref<const Eigen::MatrixXd>& tau, const Eigen::Ref<const Eigen::MatrixXd>& qd,
           const Eigen::Ref<const Eigen::MatrixXd>& qdd);

  SampleClock clock;
  Ranges ranges;
  PositionNoise noise;
  LogCheck check;
  LogFingerprint fingerprint;
  std::vector<MovingSpan> spans;  ///< of the velocities as logged
};

}  // namespace heft::data
