/// @file
/// Core's kinematics and statics behind run-time sizes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/kinematics/geometric_jacobian.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// Where the tool is, in the base frame.
struct ToolPlacement {
  Eigen::Matrix3d
      rotation;  ///< tool axes in the base frame: turns components in tool axes into base components
  Eigen::Vector3d position;  ///< the tip point [m]
};

/// Kinematics and statics of a robot with a tool, for vectors sized at run time; forwards to core's templates
/// for N = 1..kMaxJoints (heft/core/kinematics/geometric_jacobian.hpp, which holds equations and sources). n
/// joints; angles in rad, m on a prismatic joint. Any number of threads may ask at once.
class Kinematics {
 public:
  /// The tool is the robot's tip.
  /// @throws ModelError when the robot has no joint or more than kMaxJoints (heft/model/dynamics.hpp)
  explicit Kinematics(const Robot& robot);
  /// @param tool  in the last link frame (not in the tip frame); tool_beyond_tip makes one from the tip
  Kinematics(const Robot& robot, const ToolFrame<double>& tool);
  ~Kinematics();
  Kinematics(Kinematics&&) noexcept;
  Kinematics& operator=(Kinematics&&) noexcept;

  int num_joints() const;
  const Robot& robot() const;
  const ToolFrame<double>& tool() const;

  ToolPlacement tip(const Eigen::VectorXd& q) const;
  /// Geometric Jacobian 6 × n in the base frame: velocity of the tip point, then angular velocity.
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& q) const;
  /// The same motion with components in tool axes (56).
  Eigen::MatrixXd jacobian_in_tool(const Eigen::VectorXd& q) const;
  /// K_C = ∂(Jᵀ w)/∂q, n × n (89), of a wrench with components in the axes of `frame` that stays fixed to
  /// them.
  Eigen::MatrixXd complementary_stiffness(const Eigen::VectorXd& q, const ToolWrench<double>& wrench,
                                          WrenchFrame frame = WrenchFrame::kBase) const;
  /// τ = Jᵀ w, n (64).
  Eigen::VectorXd joint_torque(const Eigen::VectorXd& q, const ToolWrench<double>& wrench,
                               WrenchFrame frame = WrenchFrame::kBase) const;
  /// All at one go, for loops: placement and Jacobian in the base frame.
  ToolPlacement tip_and_jacobian(const Eigen::VectorXd& q, Eigen::MatrixXd& J) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The robot's tip as a tool.
ToolFrame<double> tip_tool(const Robot& robot);
/// A frame with the axes of the robot's tip and its origin at a point given in the tip frame [m].
ToolFrame<double> tool_beyond_tip(const Robot& robot, const Eigen::Vector3d& point);

/// Robot from a standard (distal) Denavit-Hartenberg table of revolute joints without angle offsets: base at
/// O_0, tip at the last DH frame, joints and links named joint1…, link1…; no mass, no limits.
/// @throws ModelError on an empty table
Robot make_standard_dh_robot(const std::string& name, const std::vector<DenavitHartenberg<double>>& table);

}  // namespace heft::model
