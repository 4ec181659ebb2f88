/// @file
/// An arm with drives, friction, sensors and a digital controller, simulated in continuous time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "heft/model/robot.hpp"
#include "heft/sim/controller.hpp"
#include "heft/sim/forward_dynamics.hpp"
#include "heft/sim/joint_effect.hpp"
#include "heft/sim/reference.hpp"

namespace heft::sim {

/// The solver cannot go on: says which joint and when (exit code 4 of the command).
class SimulationError : public NotIdentifiableError {
 public:
  using NotIdentifiableError::NotIdentifiableError;
};

/// How the equations of motion are integrated.
enum class SolverMethod {
  /// Runge-Kutta for an arm under a digital controller without anything stiff (elastic joints, a smooth sign, a gear coupling with
  /// friction, a joint that its viscous friction brakes in less than a fiftieth of a sample), Adams for all others.
  kAutomatic,
  kAdams,      ///< Adams-Moulton with fixed-point iteration, CVODE: for everything that is not stiff
  kBdf,        ///< backward differences with Newton and a dense Jacobian, CVODE: smooth sign, stiff springs
  kRungeKutta  ///< orders 4 and 5 from sample to sample: for everything that is not stiff
};

struct SolverSettings {
  SolverMethod method{SolverMethod::kAutomatic};
  double relative_tolerance{1e-8};
  double absolute_tolerance{1e-10};  ///< [rad, rad/s; m, m/s]
  double max_step{0.0};              ///< [s]; 0 leaves it to the solver
  /// Steps that a simulated second may take, and a thousandth of that that a sample may; the rest is saved
  /// up, to 1e5. A motion that takes more (a link of almost no inertia, gains without a torque limit) ends in SimulationError.
  double max_steps_per_second{5e5};
  /// Restart a multistep method at every controller sample instead of carrying its history across.
  /// Slower; there to be compared with.
  bool restart_at_samples{false};
};

/// How the velocity channel comes about.
enum class VelocitySource {
  kExact,       ///< true velocity plus noise
  kDifferenced  ///< difference of encoder positions through a first-order low-pass
};

/// How the acceleration channel comes about.
enum class AccelerationSource {
  kExact,       ///< true acceleration plus noise, as from an accelerometer
  kDifferenced  ///< difference of the velocity channel through a first-order low-pass
};

/// Sensors and the signals of the drive. A vector of n, or of size 0 for none (exact).
struct SensorSettings {
  Eigen::VectorXd encoder_quantum;  ///< position step [rad, m]; reading = round(q / step) · step
  Eigen::VectorXd position_noise;   ///< standard deviation before quantising [rad, m]
  VelocitySource velocity{VelocitySource::kExact};
  double velocity_cutoff_hz{0.0};  ///< low-pass of the differenced velocity; 0 for none
  Eigen::VectorXd velocity_noise;  ///< standard deviation on the exact velocity
  AccelerationSource acceleration{AccelerationSource::kExact};
  double acceleration_cutoff_hz{0.0};  ///< low-pass of the differenced acceleration; 0 for none
  Eigen::VectorXd acceleration_noise;  ///< standard deviation on the exact acceleration
  Eigen::VectorXd torque_noise;        ///< standard deviation of the reported torque [N·m, N]
  Eigen::VectorXd torque_quantum;      ///< step of the reported torque
  Eigen::VectorXd torque_constant;     ///< [N·m/A]: adds current channels i = reported torque / constant
  double sampling_jitter{0.0};         ///< half-width of the uniform error of the sampling instant [s]
};

/// A load grasped or released.
///
/// A grasped body is picked up moving with the arm: joint velocities stay as they are, momentum and kinetic
/// energy grow by the body's. On release the body leaves with the velocity it has. One body at a time.
struct PayloadEvent {
  bool grasp{true};  ///< false releases
  Body body;         ///< of a grasp
  double time{0.0};  ///< earliest time [s]
  /// When set, the event waits, from `time` on, until this joint (0-based) passes `position`.
  std::optional<int> joint;
  double position{0.0};  ///< [rad, m]
};

/// Something that happened in a simulation.
struct SimulationEvent {
  enum class Kind { kGrasp, kRelease, kStick, kSlip };
  double time;
  Kind kind;
  int joint;  ///< 0-based; −1 for the payload
};

/// Work done by the solver.
struct SolverCounts {
  long steps{0};
  long evaluations{0};  ///< of the equations of motion
  long failed_steps{0};
  long event_evaluations{0};
  long restarts{0};

  SolverCounts& operator+=(const SolverCounts& other) {
    steps += other.steps;
    evaluations += other.evaluations;
    failed_steps += other.failed_steps;
    event_evaluations += other.event_evaluations;
    restarts += other.restarts;
    return *this;
  }
};

/// A simulation's settings. Everything but robot, duration and initial position has a working default.
struct SimulationSettings {
  /// The true arm. Its friction values and joint effects are not used, `loads` are (friction_of makes them
  /// from the robot); rotor inertias, also those among the effects, couplings, elasticities and torque
  /// delay are.
  model::Robot robot;
  double duration{1.0};                    ///< [s]
  double sample_rate{1000.0};              ///< of controller and sensors [Hz]
  double log_rate{0.0};                    ///< rows a second, sample_rate / log_rate whole; 0: every sample
  Eigen::VectorXd initial_position;        ///< n
  Eigen::VectorXd initial_velocity;        ///< n, or size 0 for rest
  std::optional<Eigen::Vector3d> gravity;  ///< in the base frame, in place of the robot's [m/s²]
  /// The same over time, for instance of a base that shakes: gravity minus the base's acceleration. Null
  /// for a constant one.
  std::function<Eigen::Vector3d(double t)> gravity_of_time;
  std::vector<JointLoad> loads;                ///< n, or size 0 for none
  double coupling_smooth_speed{1e-3};          ///< the sign of gear couplings is tanh(v / this) [rad/s]
  Eigen::VectorXd torque_limit;                ///< n [N·m, N], or size 0 for none
  std::shared_ptr<const Reference> reference;  ///< null: none, no reference columns in the log
  std::shared_ptr<Controller> controller;      ///< null: `torque` acts
  /// Without a controller: torque as a function of time [N·m, N], taken continuously; null is zero torque.
  std::function<void(double t, Eigen::Ref<Eigen::VectorXd> torque)> torque;
  /// Force on the tool in the base frame over time; must be continuous. Null for none.
  std::function<Wrench(double t)> tool_wrench;
  /// A torque that the motors have to bring up on top of all else [N·m, N]; must be continuous. Null for none.
  /// @param q,qd    n, motor side
  /// @param torque  out, n, zero when called
  std::function<void(double t, const Eigen::Ref<const Eigen::VectorXd>& q,
                     const Eigen::Ref<const Eigen::VectorXd>& qd, Eigen::Ref<Eigen::VectorXd> torque)>
      disturbance;
  std::vector<PayloadEvent> payload_events;  ///< in the order in which they happen
  SensorSettings sensors;
  std::uint64_t seed{0};
  SolverSettings solver;
  /// Adds extras to the log: q_true1.., qd_true1.., qdd_true1.., tau_true1.. (motor torque), friction_true1..
  /// (torque of everything that acts at a joint other than the rigid bodies and rotors, the torque that holds a stuck
  /// joint included), kinetic_energy, potential_energy. With elastic joints also qlink1.., qdlink1.., qddlink1..,
  /// the link's motion (q_true is the motor's); energies count motors and springs in.
  bool log_truth{false};
};

/// Result of a simulation.
struct SimulationResult {
  /// Row k: sensor readings at the sample and the torque that acts from it on; qdd is taken just after the
  /// new torque has set in, so that with exact sensors a row satisfies the equations of motion.
  data::Log log;
  std::vector<SimulationEvent> events;
  SolverCounts counts;
};

/// Friction as the robot states it: Coulomb, viscous and offset, sticking at the Coulomb level, and its joint effects
/// but for rotor inertias. The smooth sign gets its usual speed, 1e-3 rad/s or 5e-4 m/s.
/// @throws ModelError for an effect on a joint that does not exist.
std::vector<JointLoad> friction_of(const model::Robot& robot, SignModel sign = SignModel::kStickSlip);

/// Adds the robot's joint effects, but for rotor inertias, to n loads. Its joints' actuation gives the
/// friction that some of them scale.
/// @throws ModelError for an effect on a joint that does not exist.
void add_joint_effects(const model::Robot& robot, std::vector<JointLoad>& loads);

/// Effort limits of the robot's joints as torque limits.
Eigen::VectorXd effort_limits_of(const model::Robot& robot);

/// Gravity seen by a base that is not level: `gravity` turned by `tilt`, so that it gains a horizontal
/// part g·sin(tilt) towards `azimuth` (from the base's x to its y).
Eigen::Vector3d tilted_gravity(const Eigen::Vector3d& gravity, double tilt, double azimuth);

/// Runs a simulation.
/// @throws ModelError on settings that do not fit together or are far out of scale, SimulationError when the solver
///         cannot go on or the controller gives a torque that is not finite.
SimulationResult simulate(const SimulationSettings& settings);

}  // namespace heft::sim
