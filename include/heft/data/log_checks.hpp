/// @file
/// What is read without complaint and yet cannot be right: degrees for radians, milliseconds for seconds,
/// a velocity with the wrong sign, joints that never move.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::data {

/// What the robot can do, as far as known. Empty vectors: not known; infinite entries: no limit.
struct JointLimits {
  Eigen::VectorXd lower, upper;   ///< positions, n [rad, m]
  Eigen::VectorXd velocity;       ///< n [rad/s, m/s]
  Eigen::VectorXd effort;         ///< n [N·m, N]
  std::vector<bool> prismatic{};  ///< n; empty: all joints are revolute
};

enum class Severity {
  kNote,  ///< worth telling; the log can be used
  kError  ///< whatever is computed from the log would be wrong
};

/// One thing found in a log.
struct LogFinding {
  Severity severity{Severity::kNote};
  std::string message;  ///< file, column, what was found, what was expected, what to do
};

/// Looks for unit slips and worthless columns; takes the rows of a log in any number of parts, memory does
/// not grow with them.
///
/// Errors:
/// - positions in degrees: beyond the limits by half as much again, or faster than five times the velocity
///   limit (30 rad/s where there is none), while a 57.3th of it is possible; or qd is a 57.3th of q's
///   derivative
/// - velocities in degrees a second: qd is 57.3 times q's derivative; accelerations likewise against qd
/// - velocities (accelerations) of the opposite sign
/// - time in milli-, micro- or nanoseconds: qd is 1000, 10⁶, 10⁹ times q's derivative, or, without qd, fewer
///   than ten samples a second of a motion by more than 0.1 rad and slower than 0.02 rad/s
/// - a clock that runs at another rate: qd of all joints that move is the same multiple of q's derivative
/// - positions that jump by a whole turn
/// - positions that jump by more than 0.1 rad (m) from one row to the next, faster than that: lost or repeated rows, encoders
///
/// Notes: smaller jumps, faster than 1.5 times the velocity limit and far more than the encoder's step and than positions
/// elsewhere leave their way; torques that stay at one value for 0.25 s while their joint moves by 0.05 rad (m) and not at one
/// acceleration, or are cut at an extreme; torques of a single row three times as large as any of two rows; time stamps late by
/// half a step and caught up with in more than one row in a thousand; joints that never move, positions beyond the limits
/// otherwise, velocities in another ratio to the derivative of q or unrelated to it, torques that look like mN·m, kN·m or per
/// cent, rows that repeat the row before, coarse position steps, fewer than two samples a second.
///
/// qd is compared with q over stretches of at least four rows and 0.05 s: the integral of qd against the
/// change of q, by regression over all stretches; stretches with a gap in time count nowhere. So encoder steps and noise hardly count; a ratio is
/// believed when the correlation is at least 0.9, and taken for a factor when within 10 % of it.
class LogCheck {
 public:
  /// @param path  for messages
  LogCheck(std::string path, int num_joints);
  ~LogCheck();
  LogCheck(LogCheck&&) noexcept;
  LogCheck& operator=(LogCheck&&) noexcept;

  /// The next rows. What the log does not have is a matrix with 0 columns.
  void add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
           const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::Ref<const Eigen::MatrixXd>& qdd,
           const Eigen::Ref<const Eigen::MatrixXd>& tau);
  /// Errors first.
  std::vector<LogFinding> findings(const JointLimits& limits = {}) const;
  /// Why qd and qdd as logged are no motion to compute with, such as "qdd4 has nothing to do with the derivative of qd
  /// (correlation 0.21)"; empty when they are, or when the log lacks one of them.
  std::string unusable_rate() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Findings of a log in memory. For one that is read piece by piece see MotionStream::check.
std::vector<LogFinding> check_log(const Log& log, const JointLimits& limits = {});

/// @throws DataError with the message of the first error, if there is one
void refuse_errors(const std::vector<LogFinding>& findings);

}  // namespace heft::data
