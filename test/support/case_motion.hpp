/// @file
/// Motions of simulated cases.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "heft/sim/simulator.hpp"
#include "support/case_random.hpp"

namespace heft::test {

/// Where a reference is at a time.
class Path : public sim::Reference {
 public:
  explicit Path(int joints) : n_(joints), top_(Eigen::VectorXd::Zero(joints)) {}
  int num_joints() const override { return n_; }
  const Eigen::VectorXd& top_speed() const { return top_; }
  /// Slows the full speed down.
  virtual void slow_down(double factor) = 0;

  void evaluate(double t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> qd,
                Eigen::Ref<Eigen::VectorXd> qdd) const override {
    constexpr double h = 3e-4;
    const Eigen::VectorXd before = position(t - h), here = position(t), after = position(t + h);
    q = here;
    qd = (after - before) / (2.0 * h);
    qdd = (after - 2.0 * here + before) / (h * h);
  }

 protected:
  virtual Eigen::VectorXd position(double t) const = 0;

  int n_;
  Eigen::VectorXd top_;  ///< speed of each joint where the path is quickest
};

/// A Fourier path, run through at full and at crawling speed in turn. While it crawls, each joint goes slowly to and fro.
/// @param brisk  with brisk moves between stops
std::shared_ptr<Path> exciting_path(const model::Robot& robot, double duration, bool brisk, Random& random);

/// Daily work: from pose to pose, all joints start and stop together, with a rest at each; the same few poses again and again.
std::shared_ptr<Path> work_path(const model::Robot& robot, Random& random);

}  // namespace heft::test
