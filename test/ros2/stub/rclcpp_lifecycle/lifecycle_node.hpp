// See test/ros2/stub/README.md.
#pragma once

#include <map>
#include <string>

#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle {

class State {};

class LifecycleNode {
 public:
  explicit LifecycleNode(std::string name) : name_(std::move(name)) {}
  const char* get_name() const { return name_.c_str(); }
  rclcpp::Logger get_logger() const { return {}; }
  bool has_parameter(const std::string& name) const { return parameters_.count(name) > 0; }
  rclcpp::Parameter get_parameter(const std::string& name) const { return parameters_.at(name); }
  template <typename T>
  T declare_parameter(const std::string& name, const T& value) {
    parameters_[name] = rclcpp::Parameter(value);
    return value;
  }

 private:
  std::string name_;
  std::map<std::string, rclcpp::Parameter> parameters_;
};

namespace node_interfaces {

class LifecycleNodeInterface {
 public:
  enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
  virtual ~LifecycleNodeInterface() = default;
  virtual CallbackReturn on_configure(const State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const State&) { return CallbackReturn::SUCCESS; }
};

}  // namespace node_interfaces
}  // namespace rclcpp_lifecycle
