/// A motion on the simulated arm, and its outcome.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "heft/excite/motion.hpp"
#include "heft/model/dynamics.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSampleRate = 500.0, kLogRate = 100.0;  // [Hz]
constexpr double kNatural = 50.0;                        // of the closed loop [rad/s]
constexpr double kSignWidth = 2e-3;                      // of the friction fed forward [rad/s, m/s]
constexpr Index kShapeStride = 5;                        // rows of the log between two checks of the shapes

/// Computed torque from the arm's own model.
class ComputedTorque final : public sim::Controller {
 public:
  explicit ComputedTorque(const model::Robot& robot) : dynamics_(robot) {}
  void control(double, const sim::Measurement& now, Eigen::Ref<VectorXd> torque) override {
    const VectorXd wanted =
        now.qdd_ref + kNatural * kNatural * (now.q_ref - now.q) + 2.0 * kNatural * (now.qd_ref - now.qd);
    torque = dynamics_.inverse_dynamics(now.q, now.qd, wanted);
    // Friction, rotors, couplings and effects as the reference moves.
    torque += dynamics_.joint_torque(now.q_ref, now.qd_ref, now.qdd_ref, kSignWidth) -
              dynamics_.inverse_dynamics(now.q_ref, now.qd_ref, now.qdd_ref);
  }

 private:
  model::Dynamics dynamics_;
};

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

/// A simulated arm that follows a reference under computed torque with its own model and friction.
sim::SimulationSettings replay_settings(const model::Robot& robot,
                                        std::shared_ptr<const sim::Reference> reference, double duration) {
  const int n = robot.num_joints();
  sim::SimulationSettings settings;
  settings.robot = robot;
  settings.loads = sim::friction_of(robot);
  settings.duration = duration;
  settings.sample_rate = kSampleRate;
  settings.log_rate = kLogRate;
  settings.initial_position.resize(n);
  VectorXd qd(n), qdd(n);
  reference->evaluate(0.0, settings.initial_position, qd, qdd);
  settings.initial_velocity = qd;
  settings.reference = std::move(reference);
  settings.controller = std::make_shared<ComputedTorque>(robot);
  settings.sensors.encoder_quantum = VectorXd::Constant(n, 2e-5);
  return settings;
}

}  // namespace

std::shared_ptr<const sim::Reference> reference_of(const PiecewiseMotion& motion, int num_joints) {
  return std::make_shared<MotionReference>(motion, num_joints);
}

sim::SimulationResult replay(const model::Robot& robot, const data::Log& motion) {
  const double begin = motion.time[0], duration = motion.time[motion.num_samples() - 1] - begin;
  const auto reference = sim::make_sampled(motion.time.array() - begin, motion.q, motion.qd, motion.qdd);
  return sim::simulate(replay_settings(robot, reference, duration));
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
      sim::simulate(replay_settings(robot, reference_of(motion, robot.num_joints()), motion.duration())).log;
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
