/// @file
/// The torque, the gravity torque or the regressor of a model along logged motions.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/score.hpp"

namespace heft::validate {

/// What is computed for every row of a log.
enum class DynamicsQuantity {
  kTorque,    ///< joint torque, with all that the drives add
  kGravity,   ///< of the rigid bodies at rest
  kRegressor  ///< the matrix that gives the torque when multiplied with the parameters
};
/// "torque", "gravity" or "regressor", as on the command line.
const char* to_string(DynamicsQuantity what);

struct DynamicsOptions {
  DynamicsQuantity what{DynamicsQuantity::kTorque};
  double band{0.0};  ///< low-pass for the figures in band [Hz]; 0: chosen from the motion
  std::function<void(const std::string& log, double done)> progress{};  ///< done within 0..1; may be empty
};

/// The values along one log.
struct LogDynamics {
  data::Log log;                    ///< with velocity and acceleration, derived where it had none
  Eigen::MatrixXd values;           ///< samples × InverseDynamics::columns
  std::optional<Score> score{};     ///< of the torque, when the log holds torque to compare with
  Eigen::VectorXd largest() const;  ///< largest absolute value of each column
};

/// A model's torque, gravity torque or regressor along logs.
struct InverseDynamics {
  std::string robot;
  DynamicsQuantity what{DynamicsQuantity::kTorque};
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  /// Torque: "tau1".. [N·m, N]. Gravity: "g1".. [N·m, N]. Regressor in core's order, row by row: "Y1_m1"..,
  /// "Y1_rotor1".. (only with torque of the motor), "Y2_m1".. [unit of torque over that of the parameter].
  std::vector<std::string> columns;
  std::vector<LogDynamics> logs;
  std::vector<std::string> notes;  ///< on how velocity and acceleration were derived
};

/// Follows the motion of every log of LogSet::judge. Friction is sharp at reversals: a joint at rest has none.
/// @param robot  whose torque is what was measured, see as_measured()
/// @throws DataError naming log, row and time of a value that is not finite
InverseDynamics inverse_dynamics_along(const model::Robot& robot, const data::LogSet& logs,
                                       const DynamicsOptions& options = {});

}  // namespace heft::validate
