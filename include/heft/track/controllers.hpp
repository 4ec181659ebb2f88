/// @file
/// Core's controllers behind the simulator's controller interface, for any robot.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "heft/sim/controller.hpp"
#include "heft/sim/reference.hpp"

namespace heft::track {

/// Controllers that a comparison sets side by side. All have the same bandwidth.
enum class Method {
  kPd,              ///< position-velocity feedback
  kPdGravity,       ///< with the gravity torque of the nominal arm
  kComputedTorque,  ///< the nominal arm
  kEstimated,       ///< computed torque with the load that is estimated while the arm moves
  kAdaptive,        ///< Slotine and Li's adaptive control of the load, see AdaptiveController
  kIdentified,      ///< computed torque with an identified arm, where the nominal one is wrong
  kArmEstimated     ///< computed torque with links, friction and load estimated while the arm moves
};
const char* to_string(Method method);

/// Settings that the controllers share. Vectors of n.
struct ControllerSettings {
  double bandwidth_hz{3.0};  ///< of the position loop: natural frequency of the error
  double damping_ratio{1.0};
  /// Inertia that PD gains are scaled with, so that the error has the bandwidth on average [kg·m², kg].
  Eigen::VectorXd inertia;
  Eigen::VectorXd torque_limit;  ///< size 0: none
  bool friction_feed_forward{true};
  // Estimator.
  int rows{1};                ///< k: torques of joints k..n are used
  double filter_hz{20.0};     ///< poles of the filter that gives motion and torque to the estimator
  double update_rate{100.0};  ///< estimator updates a second [Hz]
  /// Standard deviation of the mass before anything is known [kg]; 0: a third of the arm's mass.
  double mass_prior{0.0};
  /// First guess of the torque residual's standard deviation; size 0: from friction and weight.
  Eigen::VectorXd noise;
  /// Of kArmEstimated: how well the arm is known, see ArmEstimator.
  double doubt{0.2};
  /// Of kAdaptive: largest sum over joints of y²/M along the motion, where a joint of inertia M feels 1 kg at the last link as
  /// y [N·m/kg]. It sets the gain of the adaptation [m²/s⁴/kg].
  double load_response{50.0};
};

/// The estimate over time, one entry an update.
struct LoadTrace {
  std::vector<double> time;                   ///< of the sample, the filters' delay not taken off [s]
  std::vector<double> mass, mass_half_width;  ///< estimate and half of its 95 % interval [kg]
  /// In the last link frame [m]; NaN while the mass is unclear.
  std::vector<std::array<double, 3>> com, com_half_width;
  std::vector<double> change;  ///< when the torques showed another load [s]
  /// First time after the last change from which the mass stayed within 5 % of its last value; NaN: it never did.
  double settled_at() const;
};

/// Mean diagonal of the nominal mass matrix with rotors along a reference, n.
Eigen::VectorXd mean_inertia(const model::Robot& robot, const sim::Reference& reference, double duration);

/// ControllerSettings::load_response of a robot along a reference.
double load_response(const model::Robot& robot, const sim::Reference& reference, double duration);

/// A controller for the simulator.
/// @param nominal  the arm as the controller believes it to be, without load: friction, rotors, gear couplings,
///                 effects and elastic joints are fed forward along the reference by computed torque, and subtracted
///                 from the torque that the estimator uses. kIdentified takes its arm here, too
/// @param trace    filled by kEstimated; may be null
/// @throws ModelError when the robot has more joints or effects than heft handles
std::shared_ptr<sim::Controller> make_controller(Method method, const model::Robot& nominal,
                                                 const ControllerSettings& settings,
                                                 std::shared_ptr<LoadTrace> trace = nullptr);

}  // namespace heft::track
