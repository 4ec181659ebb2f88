/// @file
/// What dynamics_bench times, and how other libraries take part: each in a file of its own, compiled where it is there.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::bench {

/// What is computed of every state.
enum class Quantity { kTorque, kRegressor, kMassMatrix, kAcceleration };

/// m × n each, a row a state; `tau` are the torques of the motion, for accelerations.
struct StateSet {
  Eigen::MatrixXd q, qd, qdd, tau;
};

/// Results, to be compared: torques and accelerations m × n, mass matrices m × n² (M(i, j) in column i + n j), of
/// regressors their product with the robot's link parameters, m × n, and only where `checked` says so.
struct Results {
  Eigen::MatrixXd values;
  bool checked{false};  ///< not timed: fill `values` of a regressor, too
};

struct Contestant {
  std::string name;
  Quantity quantity{Quantity::kTorque};
  std::function<void(const StateSet&, Results&)> compute;
};

/// Ten parameters of every link in one column.
inline Eigen::VectorXd link_parameters_of(const model::Robot& robot) {
  Eigen::VectorXd x(10 * robot.num_joints());
  for (int j = 0; j < robot.num_joints(); ++j) {
    for (int k = 0; k < 10; ++k) {
      x[10 * j + k] = robot.joints[static_cast<std::size_t>(j)].link[static_cast<std::size_t>(k)];
    }
  }
  return x;
}

/// Other libraries on the same robot, whose joints all turn; one state at a time, as they are made for.
std::vector<Contestant> kdl_contestants(const model::Robot& robot);
std::vector<Contestant> pinocchio_contestants(const model::Robot& robot);
std::vector<Contestant> mujoco_contestants(const model::Robot& robot);

}  // namespace heft::bench
