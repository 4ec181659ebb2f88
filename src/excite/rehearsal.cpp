/// A motion on the simulated arm, and its outcome.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "heft/excite/motion.hpp"
#include "heft/sim/following.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kShapeStride = 5;  // rows of the log between two checks of the shapes

class MotionReference final : public sim::Reference {
 public:
  MotionReference(PiecewiseMotion motion, int n) : motion_(std::move(motion)), n_(n) {}
  int num_joints() const override { return n_; }
  void evaluate(double t, Eigen::Ref<VectorXd> q, Eigen::Ref<VectorXd> qd,
                Eigen::Ref<VectorXd> qdd) const override {
    VectorXd a(n_), v(n_), d(n_);
    motion_.evaluate(t, a, v, d);
    q = a;
    qd = v;
    qdd = d;
  }

 private:
  PiecewiseMotion motion_;
  int n_;
};

/// First limit that a simulated motion has passed; empty when it kept all.
std::string passed_limit(const LimitCheck& check, const Samples& motion, const data::Log& log,
                         const VectorXd& torque) {
  const Closest closest = check.closest(motion, -std::numeric_limits<double>::infinity());
  if (!(closest.slack >= 0.0)) {
    return fmt::format("{} at {:.3f} s (by {:.3g} of it, of the clearance for distances)", closest.what,
                       log.time[closest.row], -closest.slack);
  }
  for (Index j = 0; j < log.tau.cols(); ++j) {
    Index row = 0;
    const double largest = log.tau.col(j).cwiseAbs().maxCoeff(&row);
    if (!(largest <= torque[j])) {
      return fmt::format("torque of {} at {:.3f} s ({:.4g} of {:.4g})", joint_name(check.robot, j),
                         log.time[row], largest, torque[j]);
    }
  }
  return "";
}

}  // namespace

std::shared_ptr<const sim::Reference> reference_of(const PiecewiseMotion& motion, int num_joints) {
  return std::make_shared<MotionReference>(motion, num_joints);
}

sim::SimulationResult replay(const model::Robot& robot, const data::Log& motion) {
  const double begin = motion.time[0], duration = motion.time[motion.num_samples() - 1] - begin;
  const auto reference = sim::make_sampled(motion.time.array() - begin, motion.q, motion.qd, motion.qdd);
  return sim::simulate(sim::following(robot, reference, duration));
}

Rehearsal rehearse(const model::Robot& robot, const MotionLimits& limits, const PiecewiseMotion& motion) {
  Rehearsal result;
  MotionLimits allowed = limits;
  allowed.margin = 0.0;
  constexpr double kShareOfClearance = 0.5;
  const LimitCheck check(robot, allowed, kShareOfClearance);
  // Torque is taken as simulated, and an acceleration between two held torques is none of the motion's.
  allowed.torque.setConstant(std::numeric_limits<double>::infinity());
  allowed.acceleration.setConstant(std::numeric_limits<double>::infinity());
  const LimitCheck in_motion(robot, allowed, kShareOfClearance);

  result.log =
      sim::simulate(sim::following(robot, reference_of(motion, robot.num_joints()), motion.duration())).log;
  const Samples moved{result.log.q, result.log.qd, result.log.qdd};
  result.tracking_error = (result.log.q - result.log.qref).cwiseAbs().maxCoeff();
  result.use = check.use_of(moved, result.log.tau);
  result.failure = passed_limit(in_motion, moved, result.log, limits.torque);
  result.shape_distance = std::nan("");
  if (!limits.arm.capsules.empty()) {
    const collision::ShapeDistance shapes(robot, limits.shapes, check.limits.arm, limits.obstacles);
    for (Index i = 0; i < moved.q.rows(); i += kShapeStride) {
      const auto found = shapes.nearest(moved.q.row(i).transpose());
      if (!std::isfinite(found.distance)) break;
      if (!std::isnan(result.shape_distance) && found.distance >= result.shape_distance) continue;
      result.shape_distance = found.distance;
      result.nearest_shapes = found.first + ", " + found.second;
    }
    if (result.failure.empty() && result.shape_distance <= 0.0) {
      result.failure = "collision of " + result.nearest_shapes;
    }
  }
  result.passed = result.failure.empty();
  return result;
}

}  // namespace heft::excite
