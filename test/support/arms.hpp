/// @file
/// Small arms made by hand for tests.
#pragma once

#include <array>
#include <cmath>
#include <string>

#include "heft/model/robot.hpp"

namespace heft::test {

/// Ten inertial parameters from mass, centre of mass and the inertia [Ixx, Ixy, Iyy, Ixz, Iyz, Izz] about it.
inline InertialParameters<double> body(double m, std::array<double, 3> c, std::array<double, 6> i) {
  return {m,
          m * c[0],
          m * c[1],
          m * c[2],
          i[0] + m * (c[1] * c[1] + c[2] * c[2]),
          i[1] - m * c[0] * c[1],
          i[2] + m * (c[0] * c[0] + c[2] * c[2]),
          i[3] - m * c[0] * c[2],
          i[4] - m * c[1] * c[2],
          i[5] + m * (c[0] * c[0] + c[1] * c[1])};
}

/// Turns about x, then y, then z of the parent (URDF's roll, pitch, yaw), row-major.
inline std::array<double, 9> roll_pitch_yaw(double r, double p, double y) {
  const double cr = std::cos(r), sr = std::sin(r), cp = std::cos(p), sp = std::sin(p), cy = std::cos(y),
               sy = std::sin(y);
  return {cy * cp,
          cy * sp * sr - sy * cr,
          cy * sp * cr + sy * sr,
          sy * cp,
          sy * sp * sr + cy * cr,
          sy * sp * cr - cy * sr,
          -sp,
          cp * sr,
          cp * cr};
}

inline model::RobotJoint make_joint(const std::string& name, JointType type, std::array<double, 3> position,
                                    std::array<double, 9> rotation, std::array<double, 3> axis,
                                    const InertialParameters<double>& link) {
  model::RobotJoint joint;
  joint.name = name;
  joint.link_name = name + "_link";
  joint.joint.type = type;
  joint.joint.position = position;
  joint.joint.rotation = rotation;
  joint.joint.axis = axis;
  joint.link = link;
  return joint;
}

/// Two revolute joints about z in the x-y plane, gravity along −y. Links: length 0.5 and 0.4 m, mass 2 and
/// 1.5 kg, centre of mass at 0.2 and 0.25 m along x, inertia about it 0.03 and 0.02 kg·m².
inline model::Robot planar_two_link() {
  model::Robot robot;
  robot.name = "planar_two_link";
  robot.base_link = "base";
  robot.tip_link = "joint2_link";
  robot.gravity = {0.0, -9.81, 0.0};
  const auto none = roll_pitch_yaw(0, 0, 0);
  robot.joints.push_back(make_joint("joint1", JointType::kRevolute, {0, 0, 0}, none, {0, 0, 1},
                                    body(2.0, {0.2, 0, 0}, {0.001, 0, 0.03, 0, 0, 0.03})));
  robot.joints.push_back(make_joint("joint2", JointType::kRevolute, {0.5, 0, 0}, none, {0, 0, 1},
                                    body(1.5, {0.25, 0, 0}, {0.001, 0, 0.02, 0, 0, 0.02})));
  return robot;
}

/// One revolute joint about y with a point mass 1 kg at 0.5 m below the axis when q = 0: a pendulum.
inline model::Robot pendulum() {
  model::Robot robot;
  robot.name = "pendulum";
  robot.base_link = "base";
  robot.tip_link = "joint1_link";
  robot.joints.push_back(make_joint("joint1", JointType::kRevolute, {0, 0, 0}, roll_pitch_yaw(0, 0, 0),
                                    {0, 1, 0}, body(1.0, {0, 0, -0.5}, {0, 0, 0, 0, 0, 0})));
  return robot;
}

/// One prismatic joint along x carrying `mass`: a block on a level table.
inline model::Robot slider(double mass) {
  model::Robot robot;
  robot.name = "slider";
  robot.base_link = "base";
  robot.tip_link = "joint1_link";
  robot.joints.push_back(make_joint("joint1", JointType::kPrismatic, {0, 0, 0}, roll_pitch_yaw(0, 0, 0),
                                    {1, 0, 0}, body(mass, {0, 0, 0}, {1e-3, 0, 1e-3, 0, 0, 1e-3})));
  return robot;
}

/// Six revolute joints with the geometry and masses of a UR5; inertias with off-diagonal entries so that
/// every term counts; rotor inertia and friction of that size.
inline model::Robot six_joint_arm() {
  model::Robot robot;
  robot.name = "six_joint_arm";
  robot.base_link = "base";
  robot.tip_link = "wrist3_link";
  const double quarter = std::acos(0.0);
  const auto none = roll_pitch_yaw(0, 0, 0);
  const auto pitch = roll_pitch_yaw(0, quarter, 0);
  robot.joints.push_back(
      make_joint("pan", JointType::kRevolute, {0, 0, 0.089159}, none, {0, 0, 1},
                 body(3.7, {0.001, -0.002, -0.02}, {0.0103, 0.0002, 0.0102, -0.0001, 0.0003, 0.0067})));
  robot.joints.push_back(
      make_joint("lift", JointType::kRevolute, {0, 0.13585, 0}, pitch, {0, 1, 0},
                 body(8.393, {0.002, 0.001, 0.21}, {0.133, 0.0008, 0.133, -0.0005, 0.001, 0.0151})));
  robot.joints.push_back(
      make_joint("elbow", JointType::kRevolute, {0, -0.1197, 0.425}, none, {0, 1, 0},
                 body(2.33, {-0.001, 0.003, 0.2}, {0.0312, 0.0003, 0.0312, 0.0002, -0.0004, 0.0041})));
  robot.joints.push_back(
      make_joint("wrist1", JointType::kRevolute, {0, 0, 0.39225}, pitch, {0, 1, 0},
                 body(1.219, {0.001, 0.06, 0.002}, {0.0026, 0.0001, 0.0022, 0.00005, -0.0001, 0.0026})));
  robot.joints.push_back(
      make_joint("wrist2", JointType::kRevolute, {0, 0.093, 0}, none, {0, 0, 1},
                 body(1.219, {-0.001, 0.002, 0.06}, {0.0026, -0.0001, 0.0026, 0.0001, 0.00005, 0.0022})));
  robot.joints.push_back(
      make_joint("wrist3", JointType::kRevolute, {0, 0, 0.09465}, none, {0, 1, 0},
                 body(0.1879, {0.001, 0.05, -0.001}, {0.0001, 0.00001, 0.00015, 0.000005, 0.00001, 0.0001})));
  robot.tip_position = {0, 0.0823, 0};
  const std::array<double, 6> rotor{0.7, 0.7, 0.7, 0.12, 0.12, 0.12};
  const std::array<double, 6> coulomb{5, 5, 4, 1.5, 1.5, 1.2};
  const std::array<double, 6> viscous{2, 2, 1.5, 0.5, 0.5, 0.4};
  const std::array<double, 6> effort{150, 150, 150, 28, 28, 28};
  for (std::size_t i = 0; i < 6; ++i) {
    robot.joints[i].actuation = {rotor[i], coulomb[i], viscous[i], 0.0};
    robot.joints[i].effort_limit = effort[i];
    robot.joints[i].velocity_limit = 3.15;
  }
  return robot;
}

/// Its first three joints.
inline model::Robot three_joint_arm() {
  model::Robot robot = six_joint_arm();
  robot.joints.resize(3);
  robot.tip_link = robot.joints.back().link_name;
  return robot;
}

/// Two revolute joints about z, a prismatic joint downwards, a revolute wrist about it.
inline model::Robot scara_arm() {
  model::Robot robot;
  robot.name = "scara_arm";
  robot.base_link = "base";
  robot.tip_link = "wrist_link";
  const double half_turn = 2.0 * std::acos(0.0);
  const auto none = roll_pitch_yaw(0, 0, 0);
  robot.joints.push_back(make_joint("shoulder", JointType::kRevolute, {0, 0, 0.4}, none, {0, 0, 1},
                                    body(6.0, {0.17, 0.01, 0.03}, {0.02, 0.001, 0.09, -0.002, 0.001, 0.1})));
  robot.joints.push_back(
      make_joint("elbow", JointType::kRevolute, {0.35, 0, 0.05}, none, {0, 0, 1},
                 body(4.0, {0.14, -0.01, 0.02}, {0.012, 0.0005, 0.05, 0.001, -0.0005, 0.055})));
  robot.joints.push_back(
      make_joint("quill", JointType::kPrismatic, {0.3, 0, 0}, roll_pitch_yaw(half_turn, 0, 0), {0, 0, 1},
                 body(1.2, {0.002, 0.001, 0.05}, {0.006, 0.0001, 0.006, 0.0001, 0.0002, 0.0008})));
  robot.joints.push_back(
      make_joint("wrist", JointType::kRevolute, {0, 0, 0.1}, none, {0, 0, 1},
                 body(0.6, {0.02, 0.01, 0.03}, {0.001, 0.00005, 0.0012, 0.00003, 0.00002, 0.0007})));
  const std::array<double, 4> rotor{0.15, 0.08, 3.0, 0.005};
  const std::array<double, 4> coulomb{3, 2, 12, 0.3};
  const std::array<double, 4> viscous{1.2, 0.8, 25, 0.05};
  const std::array<double, 4> effort{100, 60, 300, 12};
  for (std::size_t i = 0; i < 4; ++i) {
    robot.joints[i].actuation = {rotor[i], coulomb[i], viscous[i], 0.0};
    robot.joints[i].effort_limit = effort[i];
  }
  return robot;
}

}  // namespace heft::test
