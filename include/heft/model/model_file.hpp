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
///   "gear_couplings": [ {"driving": 5, "driven": 6, "ratio": 1.0, "rotor_inertia": 0.01,
///                        "coulomb_friction": 2.0, "viscous_friction": 0.6} ],
///   "effects": [ {"kind": "stribeck", "joint": 2, "parameters": {"Fs": 1.2, "vs": 0.05}},
///                {"kind": "elasticity", "joint": 1,
///                 "parameters": {"stiffness": 9000, "damping": 8, "motor_inertia": 0.6}},
///                {"kind": "cable", "joint": 2, "driven_joint": 3, "parameters": {"k": 8, "x0": 0.2, "ratio": 1}},
///                {"kind": "delay", "joint": null, "parameters": {"delay": 0.002}} ],
///   "kinematics": {"base_link": "base", "tip_link": "flange", "gravity": [0, 0, -9.81],
///                  "tip": {"rotation": [nine, row-major], "position": [three]},
///                  "joints": [ {"type": "revolute", "rotation": [nine], "position": [three], "axis": [three],
///                               "lower": -3.1, "upper": 3.1, "velocity_limit": 2.0, "effort_limit": 330} ] },
///   "standard_deviations": [...],   "covariance": [[...], ...],
///   "fit": {"method": "wls", "torque_at": "motor", "base_parameters": [
///             {"name": "Izz1*", "unit": "kg·m²", "expression": "Izz1 + Iyy2", "value": 3.1, "std": 0.02,
///              "half_width": 0.04, "determined": true} ],
///           "effect_coefficients": [ {"effect": 1, "coefficient": 1, "value": 1.2, "std": 0.1, "half_width": 0.2} ],
///           "parameter_covariance": [[4e-4], [1e-5, 0.01]],
///           "condition_number": 12.3, "physically_consistent": true, "rmse": [...], ... },
///   "provenance": {"method": "wls", "logs": ["A.csv"], "notes": []} }
/// @endcode
///
/// Inertia is about the origin of the link frame of the URDF that the model was made with. Link k is the link
/// that joint k moves, with everything fixed to it. Joints in `gear_couplings` and `effects` count from 1. With
/// `kinematics` (frames as in heft::Joint and Robot, null for a limit that is not stated) the file is a whole robot
/// and needs no URDF. `joints`, `gear_couplings`, `effects`, `kinematics`, `standard_deviations`, `covariance`,
/// `fit` and `provenance` may be missing. Fields that heft does not know are kept when a file is read and written
/// again.
///
/// `effects` holds what acts in addition to rigid bodies, friction and couplings. Kinds are the joint effects of
/// core/effects/effects.hpp with the parameters that they name, `elasticity` of a joint (`damping`, `motor_inertia` and
/// `gap`, the play of its gear, may be missing), `cable` over two joints and `delay` of the torque channel, for the whole
/// arm. Other findings have places of their own: motors that turn with two joints in `gear_couplings`, a base that is not level in
/// `kinematics.gravity`, a body on the tool in the last of `links`.
///
/// `fit.effect_coefficients` are the coefficients that an effect's torque is linear in, in the order of its columns in
/// core/effects; effects and coefficients count from 1. `fit.parameter_covariance` is the lower triangle, row by row, of
/// the covariance of the base parameters followed by these coefficients, so that two fits can be compared.
#pragma once

#include <array>
#include <limits>
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
  std::vector<std::string> notes;  ///< anything worth knowing
};

/// Where a robot's links are: everything of a Robot but names of links and joints and dynamic parameters.
struct KinematicsRecord {
  /// A joint and its limits, as in RobotJoint.
  struct JointPlace {
    Joint<double> joint;
    double lower{-std::numeric_limits<double>::infinity()};
    double upper{std::numeric_limits<double>::infinity()};
    double velocity_limit{std::numeric_limits<double>::infinity()};
    double effort_limit{std::numeric_limits<double>::infinity()};
  };
  std::string base_link, tip_link;
  std::vector<JointPlace> joints;                  ///< base first
  std::array<double, 3> gravity{0.0, 0.0, -9.81};  ///< in the base frame [m/s²]
  std::array<double, 9> tip_rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> tip_position{0, 0, 0};
};

/// One base parameter as a fit found it.
struct BaseParameterRecord {
  std::string name;        ///< "Izz1*": an asterisk when others are grouped with it
  std::string unit;        ///< "kg·m²"
  std::string expression;  ///< "Izz1 + Iyy2 + 0.375 m3"
  double value{0.0};
  double std{0.0};         ///< standard deviation, for residuals correlated in time; NaN: unknown
  double half_width{0.0};  ///< of the 95 % interval; NaN: unknown
  bool determined{true};   ///< by the logs
};

/// One coefficient that an effect's torque is linear in, as a fit found it.
struct EffectCoefficientRecord {
  int effect{0};       ///< place in ModelFile::effects
  int coefficient{0};  ///< place among the effect's columns
  double value{0.0};
  double std{0.0};         ///< as in BaseParameterRecord
  double half_width{0.0};  ///< of the 95 % interval; NaN: unknown
};

/// How a model came out of its logs and how far to trust it: what `identify` found and `validate` repeats.
struct FitRecord {
  std::string method;  ///< "wls", ...
  /// Where the torque was measured: "motor", or "joint" (a sensor behind the gear).
  std::string torque_at{"motor"};
  std::vector<BaseParameterRecord> base_parameters;
  std::vector<EffectCoefficientRecord> effect_coefficients;
  /// Of base_parameters, then effect_coefficients, symmetric, in the squares of their units; size 0: unknown.
  Eigen::MatrixXd parameter_covariance;
  double condition_number{0.0};       ///< of the weighted base regressor, columns scaled to norm 1
  bool physically_consistent{false};  ///< every link is physically possible
  /// Squared error of the best physical fit over that of the free one; 1: physics costs nothing. NaN: unknown.
  double physical_cost_ratio{std::numeric_limits<double>::quiet_NaN()};
  Eigen::VectorXd noise_std;  ///< n: scatter of the residual behind the low-pass [N·m, N]; size 0: unknown
  // On the training logs, as defined in tools/README.md ("What an RMSE is"). Size 0: unknown.
  Eigen::VectorXd rmse, rmse_in_band, rmse_percent_of_max, r2;
  double band_hz{0.0};               ///< of the low-pass behind rmse_in_band; 0: none
  double cutoff_hz{0.0};             ///< of the low-pass on the positions of the logs; 0: chosen for each log
  double sign_width{0.0};            ///< of friction's sign [rad/s, m/s]; 0: ScoreOptions' own
  long samples{0};                   ///< rows of all logs
  std::vector<std::string> missing;  ///< what the logs did not determine, and the motion that would
};

/// Contents of a model file.
struct ModelFile {
  std::string path;   ///< where it was read from, for messages
  std::string robot;  ///< name of the robot
  std::vector<std::string> link_names;
  std::vector<std::string> joint_names;
  std::vector<InertialParameters<double>> links;  ///< one a joint, base first
  std::vector<JointActuation<double>> actuation;  ///< one a joint
  std::vector<GearCoupling<double>> couplings;
  std::vector<JointEffect<double>> effects;      ///< joints counted from 0
  std::vector<JointCable<double>> cables;        ///< joints counted from 0
  std::vector<Elasticity<double>> elasticities;  ///< joints counted from 0
  double torque_delay{0.0};                      ///< as in Robot [s]
  std::optional<KinematicsRecord> kinematics;    ///< makes the file a whole robot
  /// Of the 14n full parameters in the regressor's order: ten a link, then rotor inertia, Coulomb, viscous
  /// and offset blocks. NaN (JSON null) where the data say nothing.
  std::optional<Eigen::VectorXd> standard_deviations;
  std::optional<Eigen::MatrixXd> covariance;  ///< 14n × 14n, same order
  std::optional<FitRecord> fit;
  Provenance provenance;
  std::string other_fields;  ///< JSON text of top-level fields that heft does not know; empty: none

  int num_joints() const { return static_cast<int>(links.size()); }
};

/// The robot's present parameters as a model, with its kinematics.
ModelFile make_model(const Robot& robot);

/// The robot that a model file describes by itself.
/// @throws ModelError when the file has no kinematics; says to give the URDF.
Robot make_robot(const ModelFile& model);

/// Puts a model's parameters into a robot: every link, every joint's actuation, gear couplings, effects,
/// elasticities and delay, and the gravity that the model was fitted with (a base that is not level), unless
/// its chain begins at another link.
/// @param notes  gets a line when the model was made for a robot of another name, with link frames elsewhere, or
///               under a gravity other than the robot's; may be null
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
