/// @file
/// Torque of a long log, thinned for the eye.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace heft::validate {

/// Torque and residual of a long log, thinned while they come in: what the eye can see of them.
class TorqueTrace {
 public:
  /// Smallest and largest values over some rows [N·m, N].
  struct Extremes {
    double low, high;
  };
  /// Of one joint over one step.
  struct Step {
    Extremes measured, predicted, residual;
    double residual_mean{0.0};  ///< [N·m, N]
  };

  /// @param samples  rows to come
  TorqueTrace(long samples, Eigen::Index joints);
  void add(const Eigen::VectorXd& time, const Eigen::MatrixXd& measured, const Eigen::MatrixXd& predicted);

  Eigen::Index num_joints() const { return joints_; }
  long rows_a_step() const { return rows_a_step_; }
  const std::vector<double>& time() const { return time_; }  ///< where each step begins [s]
  /// Per step, joint by joint.
  const std::vector<std::vector<Step>>& steps() const { return steps_; }

 private:
  long rows_a_step_;
  long rows_{0};
  std::vector<double> time_;
  std::vector<std::vector<Step>> steps_;
  Eigen::Index joints_;
};

}  // namespace heft::validate
