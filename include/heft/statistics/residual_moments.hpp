/// @file
/// Autocorrelation of residuals that come piece by piece, in bounded memory.
#pragma once

#include <algorithm>
#include <cmath>
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
      if (log != s.log || time[i] - s.last > 1.5 * s.period) s.recent.clear();
      s.log = log;
      s.last = time[i];
      const double e = residual[i];
      s.products[0] += e * e;
      ++s.rows;
      for (std::size_t lag = 1; lag <= s.recent.size(); ++lag) {
        s.products[lag] += e * s.recent[s.recent.size() - lag];
        ++s.pairs[lag];
      }
      s.recent.push_back(e);
      if (s.recent.size() > kLags) s.recent.erase(s.recent.begin());
    }
  }

  /// T times correlated_samples() of each joint, T being the shortest time between its rows [s].
  Eigen::VectorXd correlation_time() const {
    Eigen::VectorXd out(static_cast<Eigen::Index>(joints_.size()));
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const Series& s = joints_[j];
      const double variance = s.rows > 0 ? s.products[0] / static_cast<double>(s.rows) : 0.0;
      const double sum = correlated_samples(
          [&](Eigen::Index k) {
            const auto lag = static_cast<std::size_t>(k);
            if (s.pairs[lag] <= 10 || !(variance > 0.0)) return 0.0;
            return s.products[lag] / static_cast<double>(s.pairs[lag]) / variance;
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
    long rows{0};
    std::vector<double> products = std::vector<double>(kLags + 1, 0.0);
    std::vector<long> pairs = std::vector<long>(kLags + 1, 0);
    std::vector<double> recent;
  };
  std::vector<Series> joints_;
};

}  // namespace heft::statistics
