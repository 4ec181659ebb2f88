/// @file
/// A robot's model in core's templates for arms that are known at run time only: ArmTorque, LoadObserver, DriveTorque.
#pragma once

#include <cstddef>
#include <string>

#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/status.hpp"
#include "heft/host/error.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// Room of such a model.
inline constexpr int kMaxEffects = 64, kMaxCouplings = 8;

/// To be used in the place of a description, with room for what robots have.
template <int N>
using ModelOf = RunTimeArm<N, kMaxEffects, kMaxCouplings>;

/// Adds effects, gear couplings and cables of a robot to one of core's models of it.
/// @throws ModelError when one does not fit
template <typename Model>
void add_parts(const Robot& robot, Model& model) {
  const auto refused = [&](std::size_t count, const char* parts, int most, const char* expected) {
    return ModelError("robot \"" + robot.name + "\" has " + std::to_string(count) + parts + " on " +
                      std::to_string(robot.num_joints()) + " joints; expected at most " +
                      std::to_string(most) + expected);
  };
  for (const JointEffect<double>& effect : robot.effects) {
    if (model.add(effect) != Status::kOk) {
      throw refused(robot.effects.size(), " effects", kMaxEffects,
                    ", each of a joint and with finite values");
    }
  }
  for (const GearCoupling<double>& coupling : robot.couplings) {
    if (model.add(coupling) != Status::kOk) {
      throw refused(robot.couplings.size(), " gear couplings", kMaxCouplings,
                    ", each of two joints and with finite values");
    }
  }
  for (const JointCable<double>& cable : robot.cables) {
    if (model.add(cable) != Status::kOk) {
      throw refused(robot.cables.size(), " cables", kMaxCouplings,
                    ", each of two joints, with finite values and a stiffness of at least 0");
    }
  }
}

/// Adds elastic joints of a robot to a model that has room for one a joint.
/// @throws ModelError when one does not fit
template <typename Model>
void add_elasticities(const Robot& robot, Model& model) {
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    if (model.add(elasticity) != Status::kOk) {
      throw ModelError("robot \"" + robot.name + "\" has " + std::to_string(robot.elasticities.size()) +
                       " elastic joints of " + std::to_string(robot.num_joints()) +
                       "; expected at most one a joint, of positive stiffness");
    }
  }
}

}  // namespace heft::model
