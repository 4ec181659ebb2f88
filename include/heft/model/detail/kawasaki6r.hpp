/// @file
/// Robot "kawasaki6r" with 6 joints, written by `heft export` from kawasaki6r.
/// Do not edit: export again.
#pragma once

#include <array>

#include "heft/core/arm_model.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/effects/elasticity.hpp"
#include "heft/core/friction/gear_coupling.hpp"

namespace heft_robots {

/// Chain from base_link to flange. SI units; inertia about the link-frame origin.
struct Kawasaki6r {
  static constexpr heft::ArmModel<double, 6> kModel{
      // type, rotation (row-major), position [m], axis
      .joints = {{
          // joint_1
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 0, -1, 0, 1, 0},
           {0, 0, 0},
           {0, 1, 0}},
          // joint_2
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 1, 0, 0, 0, 1},
           {-0.011, 0, 0},
           {0, 0, 1}},
          // joint_3
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 1, 0, 0, 0, 1},
           {-0.08, 0, 0},
           {0, 0, 1}},
          // joint_4
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 0, -1, 0, 1, 0},
           {-0.0886, 0, 0},
           {0, 1, 0}},
          // joint_5
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 0, -1, 0, 1, 0},
           {0, 0, 0},
           {0, 1, 0}},
          // joint_6
          {heft::JointType::kRevolute,
           {1, 0, 0, 0, 1, 0, 0, 0, 1},
           {0, 0.1, 0},
           {0, 0, 1}},
      }},
      // m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz
      .links = {{
          {{0.8, -0.0408, -0.064, 0, 0.015120000000000001, -0.0032639999999999995, 0.012080800000000001, 0, 0, 0.017200800000000002}},  // link_1
          {{0.4, -0.048, 0.008, 0, 0.00516, 0.0009599999999999999, 0.01076, 0, 0, 0.01092}},  // link_2
          {{0.35, -0.05550999999999999, 0.01225, 0, 0.00542875, 0.00194285, 0.013803885999999998, 0, 0, 0.014232636}},  // link_3
          {{0.2, 0, 0, 0, 0.001, 0, 0.001, 0, 0, 0.001}},  // link_4
          {{0.05, -0.0005, 0.0035000000000000005, 0, 0.000745, 3.5000000000000004e-05, 0.000505, 0, 0, 0.00075}},  // link_5
          {{0.05, 0.0005, 0.0005, 0, 0.000105, -5e-06, 0.000105, 0, 0, 0.00011}},  // link_6
      }},
      // rotor inertia, Coulomb, viscous, offset
      .actuation = {{
          {0, 0.47, 0, 0},
          {0, 1.25, 0, 0},
          {0, 1.25, 0, 0},
          {0, 0.45, 0, 0},
          {0, 0.25, 0, 0},
          {0, 0.1, 0, 0},
      }},
      .gravity = {0, 0, -9.81},
  };
  /// Placement of the tool flange in the last link frame: rotation (row-major), position [m].
  static constexpr std::array<double, 9> kTipRotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  static constexpr std::array<double, 3> kTipPosition{0, 0, 0};
  /// Motors that turn with two joints: driving, driven, ratio, rotor inertia, Coulomb, viscous.
  static constexpr std::array<heft::GearCoupling<double>, 0> kCouplings{};
  /// What else acts at joints, for heft::EffectFeedForward: kind, joint, parameters.
  static constexpr std::array<heft::JointEffect<double>, 0> kEffects{};
  /// Elastic joints: joint, stiffness, damping, motor inertia, play.
  static constexpr std::array<heft::Elasticity<double>, 0> kElasticities{};
  /// The torque channel reports the torque of this long ago [s].
  static constexpr double kTorqueDelay = 0;
};

}  // namespace heft_robots
