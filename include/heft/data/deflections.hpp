/// @file
/// Load and deflection measurements of an arm at rest: poses, the load on the tool, and how far it moved.
///
/// One row of the CSV file is one reading or several taken at once. SI units.
///
/// | column | meaning | required |
/// | --- | --- | --- |
/// | `q1..qN` | joint positions before the load came [rad, m] | yes |
/// | `fx fy fz mx my mz` | load on the tool: force [N], moment about the tip [N·m]; a column left out is 0 | one of them |
/// | `dx dy dz` | displacement of the measured point [m] | these, `rx..`, or `d` |
/// | `rx ry rz` | rotation of the tool [rad] | |
/// | `d`, `ux uy uz` | displacement along one direction [m] (a wire, a dial gauge) and that direction, of any length | |
/// | `px py pz` | the measured point, from the tip in axes of the tool [m]; 0 when left out | no |
/// | `sigma`, `sigma_r` | standard deviation of a displacement [m], of a rotation [rad] | no |
/// | `pose` | name of the pose; rows with the same name are repeats of one pose | no |
/// | `frame` | `base` or `tool`: axes of load, displacement and direction; base when left out | no |
///
/// An empty field means "not measured" in `d*` and `r*`. Other columns are left alone.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace heft::data {

/// One number read from an instrument.
struct DeflectionReading {
  bool rotation{false};       ///< of the tool about `direction`; else displacement of the point along it
  Eigen::Vector3d direction;  ///< unit vector
  double value{0.0};          ///< [m or rad]
  double sigma{0.0};          ///< standard deviation [m or rad]; 0: not known
};

/// One row: a pose under load.
struct Deflection {
  std::string pose;        ///< name, as in the file; the row's number when it has none
  std::string where;       ///< "file:line", for messages
  bool tool_axes{false};   ///< force, moment and directions are in axes of the tool, else of the base
  Eigen::VectorXd q;       ///< [rad, m]
  Eigen::Vector3d force;   ///< on the tool [N]
  Eigen::Vector3d moment;  ///< on the tool about its tip [N·m]
  Eigen::Vector3d point{0.0, 0.0, 0.0};  ///< measured, from the tip, axes of the tool [m]
  std::vector<DeflectionReading> readings;
};

/// Reads and checks a file of deflections.
/// @param num_joints  of the robot; its name is in the message when the file has another number
/// @param notes  one line for each thing worth telling (columns left alone), may be null
/// @throws DataError naming file, line and column, what was found and what was expected.
std::vector<Deflection> read_deflections(const std::string& path, int num_joints,
                                         const std::string& robot_name,
                                         std::vector<std::string>* notes = nullptr);

}  // namespace heft::data
