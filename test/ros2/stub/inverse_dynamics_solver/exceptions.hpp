// See test/ros2/stub/README.md.
#pragma once

#include <stdexcept>

#include "rclcpp/exceptions/exceptions.hpp"

namespace inverse_dynamics_solver {

using InvalidParameterValueException = rclcpp::exceptions::InvalidParameterValueException;
using ParameterUninitializedException = rclcpp::exceptions::ParameterUninitializedException;

class UninitializedException : public std::runtime_error {
 public:
  UninitializedException() : std::runtime_error("Solver is not initialized") {}
};

}  // namespace inverse_dynamics_solver
