/// @file
/// The jobs of `heft stiffness`.
#pragma once

#include <string>
#include <vector>

#include "motion_safety.hpp"
#include "options.hpp"

namespace heft::tools {

/// What hangs on the tool, for planning and for sag.
struct PayloadOptions {
  double mass{0.0};                        ///< [kg]
  std::vector<double> com{0.0, 0.0, 0.0};  ///< in the tool frame [m]
};

struct StiffnessCommandOptions {
  RobotOptions robot;
  ResultOptions result;
  std::string model;  ///< model file to write

  std::vector<std::string> measurements;
  std::string groups;
  bool complementary{false};
  bool keep_singular{false};
  bool missing_is_zero{false};

  LogOptions log;
  std::vector<std::string> validate;
  std::vector<double> rotor_inertia;  ///< on the link side of the gear [kg·m², kg]; empty: the model's

  std::vector<double> stiffness;  ///< known already [N·m/rad, N/m]
  PayloadOptions payload;
  std::string path;         ///< log whose poses the loaded tool is to follow
  std::string compensated;  ///< that log with compensated positions

  SafetyOptions safety;        ///< of planned poses
  int plan{0};                 ///< poses to choose
  std::vector<int> map{2, 3};  ///< joints (from 1) of the map of dexterity through the first pose
  std::vector<double> pull;    ///< force on the tool while measuring, base axes [N]
};

/// --measurements: compliances from load and deflection.
void stiffness_from_deflections(const StiffnessCommandOptions& options);
/// --log: from motor-side and link-side encoders, or from what the motor side alone shows.
void stiffness_from_motion(const StiffnessCommandOptions& options);
/// --stiffness: forward use of known stiffnesses.
void stiffness_forward(const StiffnessCommandOptions& options);
/// --plan: poses to measure at, as a file to be filled in.
void plan_stiffness_measurements(const StiffnessCommandOptions& options);

}  // namespace heft::tools
