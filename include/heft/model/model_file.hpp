/// @file
/// Heft's model file: the dynamic parameters of a robot as JSON, written by a fit and read by everything else.
///
/// @code{.json}
/// { "format": "heft-model", "version": 1,
///   "robot": "ur5", "num_joints": 6,
///   "units": {"mass": "kg", "first_moment": "kg m", "inertia": "kg m^2", ...},
///   "links":  [ {"name": "forearm_link", "parameters": [m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]}, ... ],
///   "joints": [ {"name": "elbow_joint", "rotor_inertia": 0.1, "coulomb_friction": 5.0,
///                "viscous_friction": 2.0, "friction_offset": 0.0}, ... ],
///   "standard_deviations": [...],   "covariance": [[...], ...],
///   "provenance": {"method": "wls", "logs": ["A.csv"], "notes": []} }
/// @endcode
///
/// Inertia is about the origin of the link frame of the URDF that the model was made with. Link k is the link
/// that joint k moves, with everything fixed to it. `joints`, `standard_deviations`, `covariance` and
/// `provenance` may be missing. Fields that heft does not know are kept when a file is read and written again.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"

namespace heft::model {

/// Where a model comes from.
struct Provenance {
  std::string method;              ///< "urdf", "ols", "recursive-least-squares"...
  std::vector<std::string> logs;   ///< logs it was fitted to
  std::vector<std::string> notes;  ///< anything worth telling
};

/// Contents of a model file.
struct ModelFile {
  std::string path;   ///< where it was read from, for messages
  std::string robot;  ///< name of the robot
  std::vector<std::string> link_names;
  std::vector<std::string> joint_names;
  std::vector<InertialParameters<double>> links;  ///< one a joint, base first
  std::vector<JointActuation<double>> actuation;  ///< one a joint
  /// Of the 14n full parameters in the regressor's order: ten a link, then rotor inertia, Coulomb, viscous
  /// and offset blocks. NaN (JSON null) where the data say nothing.
  std::optional<Eigen::VectorXd> standard_deviations;
  std::optional<Eigen::MatrixXd> covariance;  ///< 14n × 14n, same order
  Provenance provenance;
  std::string other_fields;  ///< JSON text of top-level fields that heft does not know; empty: none

  int num_joints() const { return static_cast<int>(links.size()); }
};

/// The robot's present parameters as a model.
ModelFile make_model(const Robot& robot);

/// Puts a model's parameters into a robot: every link and every joint's actuation.
/// @param notes  gets a line when the model was made for a robot of another name; may be null
/// @throws ModelError when the number of joints or a joint's name differs: the link frames would not be the
///         model's, and its parameters would mean something else.
void apply(const ModelFile& model, Robot& robot, std::vector<std::string>* notes = nullptr);

/// @throws InputError when the file cannot be read, ModelError naming file and JSON path when a field is
///         missing, of the wrong type or size, or not finite.
ModelFile read_model(const std::string& path);

/// The same from text; `path` is for messages.
ModelFile parse_model(const std::string& text, const std::string& path);

/// The model as JSON text, numbers in full precision.
std::string to_json(const ModelFile& model);

/// Writes a model file; it appears whole or not at all. `-` is standard output.
void write_model(const std::string& path, const ModelFile& model);

}  // namespace heft::model
