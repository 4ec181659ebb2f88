/// @file
/// How a model does on logs that are in a table.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/diagnose/diagnose.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// How logs are read.
struct Reading {
  double cutoff{0.0};  ///< of the low-pass on q [Hz]; 0: chosen by each stream
  /// As everyone reads them for a model that does not say how: velocities and accelerations as logged where they
  /// agree with the position, friction's sign as wide as validate has it.
  bool ordinary{false};
};

/// As the model of a diagnosis reads them.
Reading reading_of(const Diagnosis& diagnosis);

/// Logs as this room reads them.
std::vector<data::MotionStream> streams_of(const std::vector<data::Log>& logs, const Reading& reading);

/// Logs, their table and the scores of predictions along it.
class JudgedMotion {
 public:
  JudgedMotion(const model::Robot& robot, const std::vector<data::Log>& logs, const Reading& reading);
  /// Takes the motion of one joint as another reading of the same logs has it; copies keep theirs.
  void take_joint_of(const JudgedMotion& other, int joint);
  /// The same logs read with a cut-off for each joint.
  /// @param cutoffs  n, above 0 [Hz], the lowest that of this reading
  JudgedMotion with_cutoffs(const model::Robot& robot, const std::vector<data::Log>& logs, const Eigen::VectorXd& cutoffs) const;

  const std::vector<data::MotionStream>& streams() const { return *streams_; }
  const MotionTable& table() const { return *table_; }
  std::shared_ptr<const MotionTable> shared_table() const { return table_; }

  /// Torque of a robot along the motion, m × n.
  Eigen::MatrixXd predicted(const model::Robot& robot) const;
  /// Scores of each log.
  std::vector<validate::Score> scores(const Eigen::MatrixXd& predicted, double band) const;
  /// Residuals of each log for plots.
  std::vector<Traces> traces(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after) const;
  /// Rms error of each log, n each, and of all, each counting as much as another; all rows but those at the ends
  /// (validate::kScoreEnd).
  std::vector<Eigen::VectorXd> rms_errors(const Eigen::MatrixXd& predicted) const;
  /// All rows of a joint; at rest, slow, fast; all rows in band.
  static constexpr std::size_t kKinds = 5;
  /// The same rms errors of each log and kind of motion, one kind after the other, n each: root of the sum of squares over
  /// the rows of the kind by the number of all rows; 0 where a joint moves in that way for less than a second.
  /// @param band  of the errors in band [Hz]; 0: there are none
  std::vector<Eigen::VectorXd> errors_by_kind(const Eigen::MatrixXd& predicted, double band) const;
  Eigen::VectorXd rms_error(const Eigen::MatrixXd& predicted) const;

 private:
  std::shared_ptr<const std::vector<data::MotionStream>> streams_;
  std::shared_ptr<MotionTable> table_;
  double sign_width_;  ///< of friction [rad/s, m/s]
};

/// Root of the mean square of several rms errors, n.
Eigen::VectorXd pooled(const std::vector<Eigen::VectorXd>& errors);

}  // namespace heft::diagnose
