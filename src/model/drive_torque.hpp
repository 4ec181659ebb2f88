/// @file
/// From the rigid bodies' torque to the motors': actuation, gear couplings, cables, joint effects.
#pragma once

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/friction/friction.hpp"
#include "heft/host/error.hpp"
#include "heft/model/robot.hpp"
#include "heft/model/sign_width.hpp"

namespace heft::model {

/// Rotor inertia, friction and gear couplings, added to `tau`. All n, motor side.
template <typename Motion, typename Torque>
void add_actuation(const Robot& robot, const Motion& qd, const Motion& qdd, const SignWidth& sign_width,
                   Torque& tau) {
  const auto width_of = [&](int joint) {
    return sign_width.of(robot.joints[static_cast<std::size_t>(joint)].joint.type);
  };
  for (int i = 0; i < tau.size(); ++i) {
    const JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(i)].actuation;
    tau[i] += actuation.rotor_inertia * qdd[i] + friction_torque(actuation, qd[i], width_of(i));
  }
  for (const GearCoupling<double>& coupling : robot.couplings) {
    const double v = shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]);
    const double a = shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
    const double shared = gear_coupling_torque(coupling, v, a, width_of(coupling.driven));
    tau[coupling.driven] += shared;
    tau[coupling.driving] += coupling.ratio * shared;
  }
}

/// Torque of the cables, added to `tau`. Both n, motor side.
template <typename Motion, typename Torque>
void add_cables(const Robot& robot, const Motion& q, Torque& tau) {
  for (const JointCable<double>& cable : robot.cables) add_cable(cable, q, tau);
}

/// @throws ModelError for an effect, a cable or an elasticity of a joint that does not exist, an effect that does not
///         exist, or an elastic joint that is named twice or has no positive stiffness.
inline void check_effects(const Robot& robot) {
  const auto check_joint = [&robot](int joint, std::string_view what) {
    if (joint >= 0 && joint < robot.num_joints()) return;
    throw ModelError(fmt::format("robot \"{}\": {} of joint {}; expected a joint from 1 to {}", robot.name,
                                 what, joint + 1, robot.num_joints()));
  };
  for (const JointEffect<double>& effect : robot.effects) {
    if (effect.kind < 0 || effect.kind >= kNumJointEffects) {
      throw ModelError(fmt::format("robot \"{}\": effect of kind {}; expected 0 to {}", robot.name,
                                   effect.kind, kNumJointEffects - 1));
    }
    check_joint(effect.joint, "effect");
  }
  for (const JointCable<double>& cable : robot.cables) {
    check_joint(cable.driving, "cable");
    check_joint(cable.driven, "cable");
    if (cable.driving == cable.driven || !(cable.stiffness >= 0.0)) {
      throw ModelError(fmt::format("robot \"{}\": cable of stiffness {} over joints {} and {}; expected two joints and a "
                                   "stiffness of at least 0",
                                   robot.name, cable.stiffness, cable.driving + 1, cable.driven + 1));
    }
  }
  for (std::size_t k = 0; k < robot.elasticities.size(); ++k) {
    const Elasticity<double>& elasticity = robot.elasticities[k];
    check_joint(elasticity.joint, "elasticity");
    for (std::size_t other = 0; other < k; ++other) {
      if (robot.elasticities[other].joint != elasticity.joint) continue;
      throw ModelError(fmt::format("robot \"{}\": two elasticities of joint {}; expected one spring a joint",
                                   robot.name, elasticity.joint + 1));
    }
    if (!(elasticity.stiffness > 0)) {
      throw ModelError(fmt::format("robot \"{}\": stiffness {} of joint {}; expected a positive one",
                                   robot.name, elasticity.stiffness, elasticity.joint + 1));
    }
    if (!(elasticity.gap >= 0)) {
      throw ModelError(fmt::format("robot \"{}\": play {} of joint {}; expected 0 or more", robot.name,
                                   elasticity.gap, elasticity.joint + 1));
    }
  }
}

}  // namespace heft::model
