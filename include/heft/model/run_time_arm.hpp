/// @file
/// A robot's model in core's templates for arms that are known at run time only: ArmTorque, LoadObserver, DriveTorque.
#pragma once

#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/status.hpp"
#include "heft/model/robot.hpp"
#include "heft/model/sized_dynamics.hpp"

namespace heft::model {

/// Room of such a model.
inline constexpr int kMaxEffects = 64, kMaxCouplings = 8;

/// To be used in the place of a description, with room for what robots have.
template <int N>
using ModelOf = RunTimeArm<N, kMaxEffects, kMaxCouplings>;

/// What takes the parts of a robot: one of core's models behind an interface, so that the way there is compiled once.
class PartsTaker {
 public:
  virtual ~PartsTaker() = default;
  virtual Status add(const JointEffect<double>& effect) = 0;
  virtual Status add(const GearCoupling<double>& coupling) = 0;
  virtual Status add(const JointCable<double>& cable) = 0;
  virtual Status add(const Elasticity<double>& elasticity) = 0;
};

/// Hands effects, gear couplings, cables and elastic joints of a robot to a model of it.
/// @throws ModelError when one does not fit
void hand_parts(const Robot& robot, PartsTaker& model);

/// Adds effects, gear couplings, cables and elastic joints of a robot to one of core's models of it.
/// @throws ModelError when one does not fit
template <typename Model>
void add_parts(const Robot& robot, Model& model) {
  struct Taker final : PartsTaker {
    explicit Taker(Model& m) : core(m) {}
    Status add(const JointEffect<double>& effect) override { return core.add(effect); }
    Status add(const GearCoupling<double>& coupling) override { return core.add(coupling); }
    Status add(const JointCable<double>& cable) override { return core.add(cable); }
    Status add(const Elasticity<double>& elasticity) override { return core.add(elasticity); }
    Model& core;
  } taker(model);
  hand_parts(robot, taker);
}

}  // namespace heft::model
