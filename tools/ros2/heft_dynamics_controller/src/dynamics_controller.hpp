// Feed-forward by an identified model, for ros2_control: torque of the reference with the load that the arm carries, a
// proportional and derivative part, and what the samples show of load and contacts as state interfaces.
#pragma once

#include <string>
#include <vector>

#include "controller_interface/chainable_controller_interface.hpp"
#include "heft/cycle/cycle.hpp"

namespace heft_dynamics_controller {

// Parameters: `urdf`, `model`, `base_link`, `tip_link` (strings), `torque_behind_gears`, `follow_load` (bool), as in
// heft::cycle::Parameters; `joints` (strings, empty: the names of the model's joints); `kp`, `kd` (one number, or one a joint).
// Without `urdf` and `model` the robot description of the controller manager is taken.
//
// States read: position, velocity and effort of each joint. Command: effort. References, set by the controller before: position,
// velocity, acceleration of each joint. States given: load/mass, load/known, contact/detected, contact/joint.
class DynamicsController : public controller_interface::ChainableControllerInterface {
 public:
  controller_interface::CallbackReturn on_init() override;
  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State& previous) override;
  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State& previous) override;
  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;
  controller_interface::return_type update_reference_from_subscribers(
      const rclcpp::Time& time, const rclcpp::Duration& period) override;
  controller_interface::return_type update_and_write_commands(const rclcpp::Time& time,
                                                              const rclcpp::Duration& period) override;

 protected:
  std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() override;
  std::vector<hardware_interface::StateInterface> on_export_state_interfaces() override;

 private:
  bool read_states();
  bool gains(const std::string& name, std::vector<double>& values);

  heft::cycle::Cycle cycle_;
  heft::cycle::Output output_;
  std::vector<std::string> joints_;
  std::vector<double> kp_, kd_;
  // Sized in on_configure(): nothing is allocated in the loop.
  std::vector<double> q_, qd_, tau_, q_ref_, qd_ref_, qdd_ref_, command_;
};

}  // namespace heft_dynamics_controller
