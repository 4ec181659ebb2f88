/// @file
/// One sample through what a controller runs: velocity, friction, core's contact monitor. Sizes are those of run time.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/core/status.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/validate/predict.hpp"

namespace heft::monitor {

/// Positions and velocities behind a causal low-pass, and the torque behind the same, so that all are equally late: for
/// logs without velocities.
class SampleFilter {
 public:
  explicit SampleFilter(const model::Robot& robot);
  ~SampleFilter();
  /// Replaces q and tau and gives qd, all n. A refused sample gives what the one before gave.
  /// @param period  since the sample before, 0 for the first [s]
  void update(Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& tau, double period);

  class Sized;

 private:
  std::unique_ptr<Sized> sized_;
};

/// Torque beyond the rigid bodies at zero acceleration: friction, gears, effects with their memory. Joints are rigid and
/// the torque channel on time; what that leaves out is in the residual of free motion, and so in the thresholds.
class SampleFriction {
 public:
  /// @param begin  time of the first row [s]
  SampleFriction(const model::Robot& robot, double begin);
  /// Of rows that follow those of the call before, rows × n [N·m, N].
  Eigen::MatrixXd rows(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd);

 private:
  model::Dynamics dynamics_;
  validate::Predictor predictor_;
};

/// What core said about a sample: ContactMonitor::Record.
struct SampleRecord {
  Eigen::VectorXd deviation, threshold;                                 ///< n [N·m, N]
  Eigen::VectorXd residual, level_threshold, change, change_threshold;  ///< likewise
  bool judged{false}, contact{false};
  int joint{-1}, direction{0};
  ContactEvent event{ContactEvent::kNone};
  std::array<double, 4> load{};
};

/// Core's contact monitor with the arm's dynamics.
class SampleMonitor {
 public:
  /// @param period  between samples, nominal: a gap of some of them restarts the observer [s]
  /// @throws ModelError for thresholds that heft monitor --learn does not write
  SampleMonitor(const model::Robot& robot, const Thresholds& thresholds, double period);
  ~SampleMonitor();
  /// @param period  since the sample that was taken last [s]
  /// @return as ContactMonitor::update
  Status update(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& tau,
                const Eigen::VectorXd& friction, double period, SampleRecord& record);

  class Sized;

 private:
  std::unique_ptr<Sized> sized_;
};

/// @throws ModelError when the thresholds are those of another robot
void check_joints(const Thresholds& thresholds, const model::Robot& robot);

/// A contact while it lasts.
class OpenContact {
 public:
  /// @param deviation  of the sample that began it, n [N·m, N]
  OpenContact(double time, const Eigen::VectorXd& deviation, const Eigen::VectorXd& threshold);
  /// Takes the next sample, in time order.
  void add(double time, const Eigen::VectorXd& deviation, const Eigen::VectorXd& threshold);
  /// So far.
  Contact contact() const;

 private:
  Contact contact_;
  std::vector<char> above_;
};

}  // namespace heft::monitor
