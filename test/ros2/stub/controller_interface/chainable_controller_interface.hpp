// See test/ros2/stub/README.md.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hardware_interface/handle.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"

namespace controller_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : std::uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names{};
};

class ControllerInterfaceBase : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
 public:
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual return_type update(const rclcpp::Time& time, const rclcpp::Duration& period) = 0;

  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
  const std::string& get_robot_description() const { return robot_description_; }
  template <typename T>
  auto auto_declare(const std::string& name, const T& value) {
    return node_->has_parameter(name) ? node_->get_parameter(name).get_value<T>()
                                      : node_->declare_parameter(name, value);
  }
  void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface>&& commands,
                         std::vector<hardware_interface::LoanedStateInterface>&& states) {
    command_interfaces_ = std::move(commands);
    state_interfaces_ = std::move(states);
  }
  // What the controller manager does.
  CallbackReturn stub_init(const std::string& name, const std::string& robot_description) {
    node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>(name);
    robot_description_ = robot_description;
    return on_init();
  }

 protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_;
  std::string robot_description_;
};

class ChainableControllerInterface : public ControllerInterfaceBase {
 public:
  return_type update(const rclcpp::Time& time, const rclcpp::Duration& period) final {
    if (const return_type status = update_reference_from_subscribers(time, period); status != return_type::OK)
      return status;
    return update_and_write_commands(time, period);
  }
  std::vector<hardware_interface::CommandInterface> stub_references() {
    return on_export_reference_interfaces();
  }
  std::vector<hardware_interface::StateInterface> stub_states() { return on_export_state_interfaces(); }

 protected:
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() { return {}; }
  virtual std::vector<hardware_interface::StateInterface> on_export_state_interfaces() { return {}; }
  virtual return_type update_reference_from_subscribers(const rclcpp::Time& time,
                                                        const rclcpp::Duration& period) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time& time, const rclcpp::Duration& period) = 0;

  std::vector<double> state_interfaces_values_;
  std::vector<double> reference_interfaces_;
};

}  // namespace controller_interface
