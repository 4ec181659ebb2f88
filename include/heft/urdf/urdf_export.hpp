/// @file
/// A robot's parameters written back into the URDF that it was read from.
///
/// Only numbers change: values of `<inertial>` and `<dynamics>` on the robot's chain. Everything else (order,
/// comments, white space, elements that heft does not know) stays byte for byte.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"

namespace heft::urdf {

struct UrdfExportOptions {
  /// Write masses not above zero, impossible inertias and negative friction as they are, instead of
  /// refusing them. heft reads such a file with UrdfOptions::accept_impossible_values only.
  bool allow_impossible{false};
  /// Model file for what URDF has no tag for. Not set: OUT.heft.json next to OUT.urdf, where there is anything
  /// to put in it (nowhere for standard output); "": none. A name given here is written in any case.
  std::optional<std::string> side_file;
  /// Contents of the side file beyond the robot's own parameters (standard deviations, provenance, fit); its
  /// parameters are replaced by the robot's.
  std::optional<model::ModelFile> model;
};

/// Changes to the file, names in the order of the chain.
struct UrdfExportReport {
  std::vector<std::string> changed_links;   ///< links whose `<inertial>` got other values
  std::vector<std::string> inserted_links;  ///< links that got an `<inertial>`
  /// Links fixed to a moving one whose `<inertial>` is a comment now, since the moving link carries the whole.
  std::vector<std::string> set_aside_links;
  std::vector<std::string> changed_joints;  ///< joints whose `<dynamics>` got other values or was inserted
  std::vector<std::string> notes;           ///< one line for each thing worth knowing
  /// Torques of the file read again against those of the robot: largest difference on random states over the
  /// largest torque.
  double torque_difference{0.0};
  std::string side_file;  ///< model file that was written; empty: none
};

/// The URDF text with the robot's inertial parameters and friction.
///
/// - A link whose parameters are those of the file keeps its text. Otherwise its `<inertial>` keeps its form, and
///   the turn of its frame (`rpy`): mass, centre of mass and inertia are put in, numbers in the shortest form that
///   reads back as the same double. A link without `<inertial>` gets one, indented as the file is.
/// - model::RobotJoint::link is the moving link **with everything fixed to it**. The moving link gets the whole;
///   an `<inertial>` of a link fixed to it is put into a comment that says so.
/// - Coulomb and viscous coefficients go to `<dynamics friction damping>`. Rotor inertia, friction offset and
///   gear couplings have no tag; write_urdf puts them into a model file.
/// - The result is read again, and its torques (without what has no tag) are compared with the robot's on random
///   states: within 1e-9 of the largest torque.
///
/// Writing twice gives the same text.
///
/// @param original_text  text of the URDF that the robot was read from
/// @param name           of the file, for messages
/// @param report         may be null
/// @throws UrdfError when the text is no URDF, when its chain is not the robot's (names, types, placements), or
///         when a parameter is not finite or impossible: names link or joint, value and remedy.
///         Error when the torques differ: an internal failure.
std::string urdf_with_parameters(const std::string& original_text, const std::string& name,
                                 const model::Robot& robot, const UrdfExportOptions& options = {},
                                 UrdfExportReport* report = nullptr);

/// Where write_urdf puts what has no tag: OUT.heft.json next to OUT.urdf, "" for standard output and other descriptors.
std::string side_file_of(const std::string& path_out);

/// Reads a URDF, and writes it with the robot's parameters, and what URDF has no tag for into a model file (see
/// UrdfExportOptions::side_file). Each file appears whole or not at all; nothing is written on an error.
/// @param original_path  the URDF that the robot was read from; may be `path_out`
/// @param path_out       `-` is standard output
/// @throws as urdf_with_parameters; InputError when a file cannot be read or written.
void write_urdf(const std::string& original_path, const model::Robot& robot, const std::string& path_out,
                const UrdfExportOptions& options = {}, UrdfExportReport* report = nullptr);

}  // namespace heft::urdf
