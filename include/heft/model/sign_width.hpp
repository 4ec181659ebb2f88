/// @file
/// How wide the sign of friction is where it is smooth.
#pragma once

#include "heft/core/arm_model.hpp"

namespace heft::model {

/// Friction's sign is tanh(velocity / width); 0: the sharp sign, 0 at standstill.
struct SignWidth {
  double revolute{0.0};   ///< [rad/s]
  double prismatic{0.0};  ///< [m/s]

  SignWidth() = default;
  /// The same number for both.
  SignWidth(double width) : revolute(width), prismatic(width) {}  // NOLINT(google-explicit-constructor): most arms turn
  SignWidth(double of_revolute, double of_prismatic) : revolute(of_revolute), prismatic(of_prismatic) {}

  double of(JointType type) const { return type == JointType::kPrismatic ? prismatic : revolute; }
};

}  // namespace heft::model
