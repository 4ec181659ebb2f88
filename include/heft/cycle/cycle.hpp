/// @file
/// A robot's model in the cycle of a controller: inverse dynamics, the load, contacts; for a robot that is known at run time.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "heft/core/estimate/load_estimate.hpp"
#include "heft/core/status.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::cycle {

/// What a controller's parameters say.
struct Parameters {
  /// File, name of a robot that comes with heft, or the text itself; empty: the model file describes the whole robot.
  std::string urdf{};
  std::string model{};  ///< model file of identify, diagnose or `monitor --learn`; empty: what the URDF says
  std::string base_link{}, tip_link{};  ///< of the chain in the URDF; empty: as in urdf::UrdfOptions
  bool torque_behind_gears{
      false};              ///< measured torque comes from sensors behind the gears, not from the motors
  bool follow_load{true};  ///< inverse_dynamics() carries the load that update() finds
};

/// The robot that the parameters name.
/// @throws InputError (UrdfError, ModelError): what was found where, and what to do
model::Robot robot_of(const Parameters& parameters);

/// What a sample showed. Values a joint are in chain order; those beyond the robot's joints are 0.
struct Output {
  using Joints = std::array<double, model::kMaxJoints>;
  bool explained{false};  ///< the two below are of this sample
  Joints
      model_torque{};  ///< of the model with its load, half-way between the sample before and this one [N·m, N]
  Joints residual{};  ///< measured minus that [N·m, N]
  LoadState load_state{LoadState::kUnknown};
  bool load_changed{false};         ///< the torques showed another load with this sample
  double mass{0.0}, mass_std{0.0};  ///< of the load, with its standard deviation [kg]
  std::array<double, 3>
      com{};  ///< centre of mass in the last link frame; 0 where the mass is not clear of 0 [m]
  bool contact_judged{false};  ///< contacts are watched: the model has thresholds, and filters have settled
  bool contact{false};         ///< something touches the arm
  int contact_joint{-1};       ///< that shows it most against its threshold, counted from 0
  int contact_direction{0};    ///< of the torque from outside on it: 1 along positive q, -1 against
};

/// What a real-time controller asks of a model. configure() is for the time before; everything that is noexcept takes no heap,
/// does no I/O, has bounded loops, and refuses a sample by its status.
///
/// @code
/// cycle::Cycle cycle;
/// if (cycle.configure({.urdf = "ur5e", .model = "arm.json"}) != Status::kOk) std::puts(cycle.message().c_str());
/// cycle::Output out;
/// status = cycle.update(q, qd, tau, period, out);                             // every sample, in order
/// status = cycle.inverse_dynamics(q_ref, qd_ref, qdd_ref, period, tau_ref);   // every cycle, along the reference
/// @endcode
///
/// Contacts are watched where the model file holds thresholds. The load is that of LoadObserver with its usual settings.
class Cycle {
 public:
  Cycle();
  ~Cycle();
  Cycle(Cycle&&) noexcept;
  Cycle& operator=(Cycle&&) noexcept;

  /// Reads the robot and begins anew: no load, no memory. Takes heap and reads files.
  /// @return kOutOfRange: message() says why, and the arm before is kept
  Status configure(const Parameters& parameters);
  /// Why configure() refused; empty when it did not.
  const std::string& message() const noexcept { return message_; }

  int num_joints() const noexcept;  ///< 0 before configure()
  /// In chain order.
  const std::vector<std::string>& joint_names() const noexcept { return joint_names_; }
  bool watches_contacts() const noexcept;

  /// Forgets the motion and the load.
  void reset() noexcept;

  /// Motor torque at the next point of a reference: rigid bodies with the load, rotors, friction, couplings and effects, as in
  /// ArmTorque.
  /// @param q,qd,qdd  n [rad, rad/s, rad/s²; m on a prismatic joint]
  /// @param period    since the point before, > 0 [s]
  /// @param tau       n [N·m, N]
  /// @return kOutOfRange (a size or the period), kNonFiniteInput, kNotConfigured: tau and memory unchanged
  Status inverse_dynamics(std::span<const double> q, std::span<const double> qd, std::span<const double> qdd,
                          double period, std::span<double> tau) noexcept;

  /// Takes one measured sample.
  /// @param q,qd    n [rad, rad/s; m on a prismatic joint]
  /// @param tau     n, that acted since the sample before, as Parameters::torque_behind_gears says [N·m, N]
  /// @param period  since the sample before, > 0; of the first one that of the loop [s]
  /// @return as above; `out` unchanged unless kOk
  Status update(std::span<const double> q, std::span<const double> qd, std::span<const double> tau,
                double period, Output& out) noexcept;

  class Sized;

 private:
  std::unique_ptr<Sized> sized_;
  std::vector<std::string> joint_names_;
  std::string message_;
};

}  // namespace heft::cycle
