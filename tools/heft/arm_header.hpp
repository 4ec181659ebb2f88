/// @file
/// A robot as C++ source for firmware.
#pragma once

#include <string>

#include "heft/model/robot.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::tools {

/// What the header is called inside.
struct ArmHeaderNames {
  std::string type;             ///< name of the struct, a C++ identifier
  std::string name_space;       ///< "a::b"; empty: none
  std::string source_of_truth;  ///< for the comment at the top: which URDF, which model
};

/// A header with `struct <type> { static constexpr heft::ArmModel<double, N> kModel; ... }`, a description
/// that the compile-time dynamics take. Entries of rotations and axes within 1e-12 of 0 or ±1 are written as
/// such, since those are what the compile-time dynamics eliminate. Next to kModel are kCouplings, kEffects and
/// kElasticities (arrays, empty when there are none), kTorqueDelay, kTipRotation and kTipPosition.
/// @param thresholds  of contacts, as kThresholds; null: none
/// @throws InputError when a name is not an identifier.
std::string arm_header(const model::Robot& robot, const ArmHeaderNames& names,
                       const monitor::Thresholds* thresholds = nullptr);

/// A type name made from a robot's name: "ur10e-left" gives "Ur10eLeft".
std::string type_name_of(const std::string& robot_name);

}  // namespace heft::tools
