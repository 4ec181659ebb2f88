/// @file
/// Core's load observer on rows as they come, for an arm that is known at run time, with intervals that hold the arm model's
/// error.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "arm_error.hpp"
#include "beyond_regressor.hpp"
#include "heft/core/estimate/load_estimate.hpp"
#include "heft/data/live_log.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"
#include "heft/payload/payload.hpp"
#include "payload_run.hpp"
#include "row_limits.hpp"

namespace heft::payload {

/// Rows as a controller hands them to heft::LoadObserver, with three things in addition: late torque (motion is taken as late),
/// velocities where the rows have none (differences), and a torque scale that is known: torque is divided by it, except for the arm's
/// own part, which was fitted as measured.
///
/// Settings follow from the fit of the arm: the filter is its fast one (causal_signals.hpp), the guess of the noise its residual, and
/// updates come three times a period of its low-pass: counting samples closer together as independent makes the observer certain too
/// early. The friction of every joint in use may differ from the model.
class LoadFollower {
 public:
  /// What became of a row.
  struct Taken {
    bool refused{false};    ///< it left no trace but its time
    int joint{-1};          ///< refused: whose torque, velocity or step no such arm can have; -1: not that
    bool estimated{false};  ///< the estimate is another one
    bool changed{false};    ///< the torques show another load
  };

  /// @param arm      without load, as its torque was measured (model::as_measured)
  /// @param options  `gate` and `standstill_speed` are not used
  /// @param period   of the rows [s]
  /// @throws ModelError when core refuses the arm
  LoadFollower(const model::Robot& arm, const PayloadRunOptions& options, double period);
  ~LoadFollower();

  /// @pre row.time is beyond that of the row before
  Taken take(const data::LiveRow& row);
  LoadState state() const;
  /// The load as of now, whatever the state. Cost: products of 10 × 14 n matrices; not for every row.
  LoadValue load() const;

  class Sized;

 private:
  /// Torque in true units.
  Eigen::VectorXd scaled(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                         const Eigen::VectorXd& tau) const;
  void add_rows();

  PayloadRunOptions options_;
  model::Dynamics dynamics_;
  RowLimits limits_;
  Eigen::Matrix<double, 10, 10> to_flange_;
  Eigen::VectorXd noise_, together_;  ///< of ArmError, one a joint
  double period_, rate_;              ///< [s]; updates of the estimate [Hz]
  LateMotion late_;
  std::unique_ptr<Sized> core_;
  std::unique_ptr<ArmError> error_;
  data::LiveRow last_;        ///< that was taken
  Eigen::VectorXd last_tau_;  ///< the same in true units
  double last_step_{0.0};     ///< before it [s]; 0: there was none
  bool started_{false}, restart_due_{false};
};

}  // namespace heft::payload
