/// @file
/// What a torque could be a function of: signals of a motion for estimates that know no model.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Signals of one motion at every row of its table.
struct MotionSignals {
  Eigen::MatrixXd load;       ///< m × n: torque of the rigid bodies [N·m, N]
  Eigen::MatrixXd load_rate;  ///< m × n: its derivative by time
  /// m × n each: the sign of the displacement, forgotten over a distance, one for each of kMemories.
  std::vector<Eigen::MatrixXd> memory;
  Eigen::MatrixXd earlier_qd;      ///< m × n: velocity kLag before
  Eigen::MatrixXd since_reversal;  ///< m × n: time since the joint last turned back, kLongest at most [s]

  static constexpr double kLag = 0.1;      ///< [s]
  static constexpr double kLongest = 1.0;  ///< [s]
};

/// Torque of a robot's rigid bodies, m × n [N·m, N].
Eigen::MatrixXd load_of(const model::Robot& robot, const MotionTable& table);

/// @param robot  whose rigid bodies give the load
MotionSignals signals_of(const model::Robot& robot, const MotionTable& table);

/// Rows of one or several motions, picked for one joint.
struct JointSignals {
  /// m × p: terms that a torque is often linear in: the base parameters' own columns, so that what a fit of the arm
  /// has taken up of a function can be given back, and plain terms of friction, load and neighbours.
  Eigen::MatrixXd terms;
  Eigen::MatrixXd features;  ///< m × k: what an unknown function may ask for
};

/// Signals of picked rows, one entry a joint. Time is not among them: what changes with nothing but time is no function
/// of the motion.
/// @param rows  of the table, ascending
std::vector<JointSignals> joint_signals(const model::Robot& robot, const MotionTable& table,
                                        const MotionSignals& signals, const std::vector<Eigen::Index>& rows);

}  // namespace heft::diagnose
