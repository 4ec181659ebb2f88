/// @file
/// Autocorrelation of residuals that come piece by piece, in bounded memory.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "heft/statistics/correlation.hpp"

namespace heft::statistics {

/// Sums of residual products for lags up to kLags rows, per joint.
class ResidualMoments {
 public:
  static constexpr int kLags = 400;

  explicit ResidualMoments(int joints) : joints_(static_cast<std::size_t>(joints)) {}

  /// Residuals of one joint in time order; a break in time or another log starts a new series.
  void add(int log, int joint, const Eigen::VectorXd& time, const Eigen::VectorXd& residual) {
    Series& s = joints_[static_cast<std::size_t>(joint)];
    for (Eigen::Index i = 0; i < residual.size(); ++i) {
      if (i + 1 < time.size()) s.period = std::min(s.period, time[i + 1] - time[i]);
      if (log != s.log || time[i] - s.last > 1.5 * s.period) s.before = 0;
      s.log = log;
      s.last = time[i];
      s.add(residual[i]);
    }
  }

  /// T times correlated_samples() of each joint, T being the shortest time between its rows [s].
  Eigen::VectorXd correlation_time() const {
    Eigen::VectorXd out(static_cast<Eigen::Index>(joints_.size()));
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const Series& s = joints_[j];
      const std::vector<long> pairs = s.pairs();
      const double variance = pairs[0] > 0 ? s.products[kLags] / static_cast<double>(pairs[0]) : 0.0;
      const double sum = correlated_samples(
          [&](Eigen::Index k) {
            const auto lag = static_cast<std::size_t>(k);
            if (pairs[lag] <= 10 || !(variance > 0.0)) return 0.0;
            return s.products[kLags - lag] / static_cast<double>(pairs[lag]) / variance;
          },
          kLags + 1);
      out[static_cast<Eigen::Index>(j)] = s.period < 1e9 ? s.period * sum : 0.0;
    }
    return out;
  }

 private:
  struct Series {
    int log{-1};
    double last{0.0};
    double period{1e9};
    std::size_t before{0};  ///< residuals known before the next one, kLags at most
    /// The last residuals, `before` of them in front of `end`; twice the room, so that they rarely have to be moved.
    std::vector<double> recent = std::vector<double>(2 * kLags, 0.0);
    std::size_t end{0};
    /// Of lag l at kLags - l: as the residuals lie.
    std::vector<double> products = std::vector<double>(kLags + 1, 0.0);
    std::vector<long> with_before = std::vector<long>(kLags + 1, 0);  ///< residuals by how many were known before

    void add(double residual) {
      if (end == recent.size()) {
        std::copy_n(recent.end() - static_cast<std::ptrdiff_t>(before), before, recent.begin());
        end = before;
      }
      const double* const known = recent.data() + (end - before);
      double* const sums = products.data() + (kLags - before);
      for (std::size_t i = 0; i < before; ++i) sums[i] += residual * known[i];
      products[kLags] += residual * residual;
      ++with_before[before];
      recent[end++] = residual;
      before = std::min<std::size_t>(before + 1, kLags);
    }
    /// Pairs of residuals by lag.
    std::vector<long> pairs() const {
      std::vector<long> sums = with_before;
      for (std::size_t lag = kLags; lag > 0; --lag) sums[lag - 1] += sums[lag];
      return sums;
    }
  };
  std::vector<Series> joints_;
};

}  // namespace heft::statistics
