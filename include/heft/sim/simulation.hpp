/// @file
/// A simulation that has been run: what it was of, what happened in it, how well the arm followed.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/sim/simulator.hpp"

namespace heft::sim {

/// "grasp", "release", "stick" or "slip".
const char* to_string(SimulationEvent::Kind kind);

struct Simulation {
  std::string robot;
  std::string source;  ///< path of the scenario, or of the motion that was replayed
  bool is_replay{false};
  SimulationResult result;

  double duration() const;  ///< from the first row of the log to the last [s]
  /// Grasps and releases, in the order in which they happened.
  std::vector<SimulationEvent> payload_events() const;
  int times_stuck() const;  ///< how often a joint came to stick
  /// n: root mean square of reference minus position [rad, m]; size 0 without a reference.
  Eigen::VectorXd tracking_error() const;
  /// n [N·m, N]; size 0 without torque.
  Eigen::VectorXd largest_torque() const;
};

}  // namespace heft::sim
