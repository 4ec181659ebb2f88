/// @file
/// How much of a residual could any function of the motion explain?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/diagnose/diagnose.hpp"
#include "heft/model/robot.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Residuals of two models along one table, the rows of which are those of the table.
struct LogResiduals {
  const MotionTable* table;
  Eigen::MatrixXd before, after;  ///< m × n, measured minus predicted torque [N·m, N]
};

struct CeilingEstimate {
  std::vector<Ceiling> joints;  ///< n
  /// m × n: what an unknown function of the motion says of the residual `after` on the judged rows, each row by a
  /// function that was fitted to other stretches; between rows that were looked at, straight lines. 0: nothing.
  Eigen::MatrixXd function;
};

/// Fits functions of no particular form to the residual that a model leaves and judges them on stretches of seconds
/// that they were not fitted to: terms that a torque is often linear in, by ridge regression, and boosted trees on
/// position, velocity, acceleration, load, memory of the displacement and short lags of all joints. Each joint takes
/// what does best; a joint where neither helps has nothing more to explain. These functions are a measure of what is
/// left: they hold nowhere but along these motions, and no model file gets them.
///
/// An unknown function is found only as far as the logs show it, so that what it explains is a lower bound; what the
/// model explains counts as explainable.
///
/// Cost: some ten thousand rows, O(1 s) for seven joints, whatever the length of the logs.
///
/// @param robot   the model that left `after`; its rigid bodies give the loads
/// @param others  residuals of the logs that the model was fitted to; functions learn from them
/// @param judged  residuals that are judged on; functions learn from those of its stretches that are not judged at the
///                time
CeilingEstimate ceiling_of(const model::Robot& robot, const LogResiduals& others, const LogResiduals& judged);

}  // namespace heft::diagnose
