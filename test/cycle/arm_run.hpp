/// @file
/// An arm that moves all its joints, sample by sample, in the place of a robot.
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::test {

class ArmRun {
 public:
  static constexpr double kPeriod = 0.002;  ///< [s]

  struct Motion {
    Eigen::VectorXd q, qd, qdd;
  };
  struct Sample {
    std::vector<double> q, qd, tau;
  };

  explicit ArmRun(const model::Robot& robot) : dynamics_(robot) {}

  static Motion motion(double t, int joints) {
    Motion m{Eigen::VectorXd(joints), Eigen::VectorXd(joints), Eigen::VectorXd(joints)};
    for (int i = 0; i < joints; ++i) {
      const double w = 1.1 + 0.4 * i, a = 0.6;
      m.q[i] = a * std::sin(w * t) + 0.2 * i;
      m.qd[i] = a * w * std::cos(w * t);
      m.qdd[i] = -a * w * w * std::sin(w * t);
    }
    return m;
  }

  /// The next sample; its torque acted half-way since the one before.
  Sample next() {
    const int n = dynamics_.num_joints();
    const double t = kPeriod * ++count_;
    const Motion now = motion(t, n), middle = motion(t - 0.5 * kPeriod, n);
    const Eigen::VectorXd tau = dynamics_.joint_torque(middle.q, middle.qd, middle.qdd, 0.02);
    return {{now.q.begin(), now.q.end()}, {now.qd.begin(), now.qd.end()}, {tau.begin(), tau.end()}};
  }

 private:
  model::Dynamics dynamics_;
  int count_{0};
};

}  // namespace heft::test
