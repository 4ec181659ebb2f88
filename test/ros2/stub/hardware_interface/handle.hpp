// See test/ros2/stub/README.md.
#pragma once

#include <optional>
#include <string>

namespace hardware_interface {

class Handle {
 public:
  Handle(const std::string& prefix, const std::string& interface, double* value = nullptr)
      : name_(prefix + "/" + interface), value_(value) {}
  const std::string& get_name() const { return name_; }
  double* stub_value() const { return value_; }

 private:
  std::string name_;
  double* value_;
};

class CommandInterface : public Handle {
 public:
  using Handle::Handle;
};

class StateInterface : public Handle {
 public:
  using Handle::Handle;
};

class LoanedCommandInterface {
 public:
  explicit LoanedCommandInterface(CommandInterface& interface) : interface_(&interface) {}
  template <typename T>
  [[nodiscard]] bool set_value(const T& value, unsigned int /*max_tries*/ = 10) {
    *interface_->stub_value() = value;
    return true;
  }

 private:
  CommandInterface* interface_;
};

class LoanedStateInterface {
 public:
  explicit LoanedStateInterface(StateInterface& interface) : interface_(&interface) {}
  template <typename T = double>
  [[nodiscard]] std::optional<T> get_optional(unsigned int /*max_tries*/ = 10) const {
    return *interface_->stub_value();
  }

 private:
  StateInterface* interface_;
};

}  // namespace hardware_interface
