/// @file
/// A measured or simulated log: the one time-series format of heft (a CSV file with a header line).
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heft::data {

/// Time series of an arm. SI units. Matrices are samples × joints; a channel that the log does not
/// have is a matrix with 0 columns.
struct Log {
  std::string path;         ///< where it was read from, for messages
  Eigen::VectorXd time;     ///< [s], strictly increasing
  Eigen::MatrixXd q;        ///< joint positions [rad, m]
  Eigen::MatrixXd qd;       ///< velocities
  Eigen::MatrixXd qdd;      ///< accelerations
  Eigen::MatrixXd tau;      ///< joint torques [N·m, N]
  Eigen::MatrixXd current;  ///< motor currents `i1..` [A]
  Eigen::MatrixXd qref, qdref, temperature;
  /// Every other numeric column by its header, carried along (for instance tauref1, qlink2).
  std::vector<std::pair<std::string, Eigen::VectorXd>> extra;

  int num_joints() const { return static_cast<int>(q.cols()); }
  int num_samples() const { return static_cast<int>(time.size()); }
};

/// What a file does not say of itself.
struct ReadAs {
  std::string topic{};  ///< of a bag with several of joint states; empty: the only one
  std::vector<std::string>
      joint_names{};  ///< of the robot, base first, where a log names its joints; empty: in its order
  /// Columns by the file's names: {heft's name or prefix, the file's}, e.g. {"tau", "effort"}.
  std::vector<std::pair<std::string, std::string>> map{};
};

/// What the caller needs of a log.
struct LogRequirements {
  int num_joints{0};       ///< expected number of joints; 0 accepts any
  std::string robot_name;  ///< named in the message when the joint count differs
  bool velocity{false};
  bool acceleration{false};
  bool torque{false};  ///< tau, or current with torque_constant
  int min_samples{2};  ///< fewer end in an error that says so
  /// [N·m/A] per joint (one value serves all); used as tau = constant · i when tau is missing.
  std::vector<double> torque_constant;
  ReadAs as{};
};

/// Reads and checks a log.
/// @param notes  one line for each thing worth telling (unknown columns), may be null
/// @throws DataError naming file, line and column, what was found and what was expected.
Log read_log(const std::string& path, const LogRequirements& needs,
             std::vector<std::string>* notes = nullptr);

/// The log as CSV text (header, then rows, full precision), columns in the order of src/data/README.md, extras last.
std::string to_csv(const Log& log);

/// Writes a log; the file appears whole or not at all. `-` is standard output.
void write_log(const std::string& path, const Log& log);

}  // namespace heft::data
