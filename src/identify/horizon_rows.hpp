/// @file
/// From samples of a running arm to rows of a regression: few a second, all with the same delay.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heft/core/filter/aligned_motion.hpp"
#include "heft/core/status.hpp"
#include "heft/identify/moving_horizon.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::identify {

/// Rows of one instant, one of each joint that moves.
struct HorizonTick {
  double time{0.0};         ///< [s]
  std::vector<int> joints;  ///< m, ascending
  Eigen::MatrixXd W;        ///< m × u
  Eigen::VectorXd y;        ///< m: torque less what is known of it [N·m, N]
};

/// Filter, rest and spacing of rows. The filter yields velocity and acceleration and keeps what it needs in the same
/// delay, 3/ω; the regressor is worked out for the rows that are kept only.
class HorizonRows {
 public:
  /// @param unknown  u columns, ascending; the torque of all others is taken off
  HorizonRows(std::shared_ptr<const regression::RegressionColumns> columns, std::vector<int> unknown,
              const HorizonOptions& options);

  /// @param tick  filled where a row was due and a joint moved
  /// @return kNonFiniteInput, kOutOfRange (time): nothing changed
  Status add(const HorizonSample& sample, std::optional<HorizonTick>& tick);

 private:
  void restart();
  void watch_rest(double time, const Eigen::VectorXd& qd);
  std::optional<HorizonTick> tick_at(double time) const;

  std::shared_ptr<const regression::RegressionColumns> columns_;
  std::vector<int> unknown_;
  Eigen::VectorXd known_;  ///< p: 0 where unknown
  double rest_speed_, spacing_, time_constant_;
  std::vector<AlignedMotion<double, 1>> joints_;
  std::vector<double> last_fast_, useful_from_;  ///< per joint [s]
  Eigen::VectorXd last_q_;
  double time_{kNaN}, next_{0.0};
};

}  // namespace heft::identify
