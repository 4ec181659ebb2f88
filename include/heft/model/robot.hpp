/// @file
/// A robot on the host: names, limits and the arm's data with the number of joints known at run time.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "heft/core/arm_model.hpp"
#include "heft/core/effects/cable.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/effects/elasticity.hpp"
#include "heft/core/friction/gear_coupling.hpp"
#include "heft/core/joint_spec.hpp"

namespace heft::model {

/// One joint of the chain with the link it moves.
struct RobotJoint {
  std::string name;       ///< joint name
  std::string link_name;  ///< name of the link it moves
  Joint<double> joint;
  InertialParameters<double>
      link{};  ///< of the moved link with everything fixed to it, about the link-frame origin
  JointActuation<double> actuation{};
  double lower{-std::numeric_limits<double>::infinity()};  ///< position limits [rad or m]
  double upper{std::numeric_limits<double>::infinity()};
  double velocity_limit{std::numeric_limits<double>::infinity()};  ///< [rad/s or m/s]
  double effort_limit{std::numeric_limits<double>::infinity()};    ///< [N·m or N]
};

/// Largest play of a gear that files are believed [rad, m]: beyond any gear, while a number in degrees soon is above it.
inline constexpr double kLargestGap = 0.5;

/// A serial robot: the chain from a base link to a tip link, base first.
struct Robot {
  std::string name;
  std::string base_link;
  std::string tip_link;
  std::vector<RobotJoint> joints;
  std::vector<GearCoupling<double>> couplings{};   ///< motors that turn with two joints
  std::vector<JointCable<double>> cables{};        ///< that run over two joints
  std::vector<JointEffect<double>> effects{};  ///< what acts at joints in addition to the declared friction
  std::vector<Elasticity<double>> elasticities{};  ///< joints that give; then q is the motor's position
  double torque_delay{0.0};  ///< the torque channel reports τ(t - delay) at t, q is on time [s]
  std::array<double, 3> gravity{0.0, 0.0, -9.81};  ///< in the base frame [m/s²]
  /// Placement of the tip (tool flange) in the last link frame: rotation row-major, position [m].
  std::array<double, 9> tip_rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> tip_position{0, 0, 0};

  int num_joints() const { return static_cast<int>(joints.size()); }
  /// Kind and limits of the joints, base first: what a log of this robot is checked against.
  std::vector<JointSpec> joint_specs() const {
    std::vector<JointSpec> specs;
    specs.reserve(joints.size());
    for (const RobotJoint& joint : joints) {
      specs.push_back({joint.joint.type, joint.lower, joint.upper, joint.velocity_limit, joint.effort_limit});
    }
    return specs;
  }
};

/// The same arm as the fixed-size model that core works on.
/// @pre robot.num_joints() == N
template <int N>
ArmModel<double, N> to_arm_model(const Robot& robot) {
  ArmModel<double, N> arm;
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    arm.joints[i] = robot.joints[i].joint;
    arm.links[i] = robot.joints[i].link;
    arm.actuation[i] = robot.joints[i].actuation;
  }
  arm.gravity = robot.gravity;
  return arm;
}

}  // namespace heft::model
