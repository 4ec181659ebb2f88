#include "left_out.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "heft/model/motion_torque.hpp"

namespace heft::exchange {
namespace {

using Eigen::Index;

/// A motion through half of each joint's range, no faster than a third of its top speed. The frequencies of the joints have
/// no common period, so that all combinations of positions and directions come up.
class TypicalMotion {
 public:
  explicit TypicalMotion(const model::Robot& robot) {
    constexpr double kLength = 20.0, kRate = 100.0;  // [s], [Hz]
    constexpr double kAmplitude = 1.0, kTravel = 0.2,
                     kTopSpeed = 1.5;  // where there are no limits [rad], [m], [rad/s]
    const Index rows = static_cast<Index>(kLength * kRate), n = robot.num_joints();
    time = Eigen::VectorXd::LinSpaced(rows, 0.0, (static_cast<double>(rows) - 1.0) / kRate);
    q.resize(rows, n), qd.resize(rows, n), qdd.resize(rows, n);
    for (Index j = 0; j < n; ++j) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      const bool limited =
          std::isfinite(joint.lower) && std::isfinite(joint.upper) && joint.upper > joint.lower;
      const double most = joint.joint.type == JointType::kPrismatic ? kTravel : kAmplitude;
      const double amplitude = limited ? std::min(most, 0.25 * (joint.upper - joint.lower)) : most;
      const double middle = limited ? std::clamp(0.0, joint.lower + amplitude, joint.upper - amplitude) : 0.0;
      const double top = std::isfinite(joint.velocity_limit) && joint.velocity_limit > 0.0
                             ? joint.velocity_limit
                             : kTopSpeed;
      const double w =
          std::min(top, 2.0 * kTopSpeed) / 3.0 / amplitude * (1.0 - 0.1 * std::sqrt(static_cast<double>(j)));
      const Eigen::ArrayXd angle = w * time.array() + static_cast<double>(j);
      q.col(j) = middle + amplitude * angle.sin();
      qd.col(j) = amplitude * w * angle.cos();
      qdd.col(j) = -amplitude * w * w * angle.sin();
    }
  }
  Eigen::MatrixXd torque(const model::Robot& robot) const {
    const Eigen::MatrixXd steps = displacements();
    return model::MotionTorque(robot).torque(
        time, q, qd, qdd, 0.0, model::needs_measured_displacement(robot) ? steps : Eigen::MatrixXd());
  }

 private:
  /// Since the row before, as logged velocities and held positions have them: here one as the other.
  Eigen::MatrixXd displacements() const {
    Eigen::MatrixXd steps = Eigen::MatrixXd::Zero(q.rows(), 2 * q.cols());
    const Eigen::MatrixXd difference = q.bottomRows(q.rows() - 1) - q.topRows(q.rows() - 1);
    steps.bottomRows(q.rows() - 1) << difference, difference;
    return steps;
  }

  Eigen::VectorXd time;
  Eigen::MatrixXd q, qd, qdd;
};

double rms(const Eigen::MatrixXd& m, Index column) {
  return std::sqrt(m.col(column).squaredNorm() / static_cast<double>(m.rows()));
}

/// Removes one thing after the other from a copy of the robot, and sees what that does to the torque.
class Shares {
 public:
  explicit Shares(const model::Robot& robot)
      : robot_(robot), motion_(robot), torque_(motion_.torque(robot)) {}

  void add(std::string what, int joint, const std::function<void(model::Robot&)>& remove) {
    model::Robot without = robot_;
    remove(without);
    const Eigen::MatrixXd difference = torque_ - motion_.torque(without);
    const auto share = [&](Index j) {
      const double whole = rms(torque_, j);
      return whole > 0.0 ? rms(difference, j) / whole : std::numeric_limits<double>::quiet_NaN();
    };
    double most = joint >= 0 ? share(joint) : 0.0;
    for (Index j = 0; joint < 0 && j < torque_.cols(); ++j) most = std::max(most, share(j));
    found.push_back({std::move(what), joint, most});
  }

  std::vector<LeftOut> found;

 private:
  const model::Robot& robot_;
  TypicalMotion motion_;
  Eigen::MatrixXd torque_;
};

bool is_level(const std::array<double, 3>& gravity) {
  return gravity[0] == 0.0 && gravity[1] == 0.0 && gravity[2] < 0.0;
}

}  // namespace

JointSpring spring_of(const model::Robot& robot, int joint) {
  // Σ k (q - q0) = K q - Σ k q0
  JointSpring sum;
  double moment = 0.0;
  for (const JointEffect<double>& effect : robot.effects) {
    if (effect.joint != joint || effect.kind != joint_effect_kind<Spring>()) continue;
    sum.stiffness += effect.parameters[0];
    moment += effect.parameters[0] * effect.parameters[1];
  }
  if (sum.stiffness > 0.0) sum.rest = moment / sum.stiffness;
  return sum;
}

double rotor_inertia_of(const model::Robot& robot, int joint) {
  double sum = robot.joints[static_cast<std::size_t>(joint)].actuation.rotor_inertia;
  for (const JointEffect<double>& effect : robot.effects) {
    if (effect.joint == joint && effect.kind == joint_effect_kind<RotorInertia>())
      sum += effect.parameters[0];
  }
  return sum;
}

std::vector<LeftOut> left_out(const model::Robot& robot, const Places& places) {
  Shares shares(robot);
  for (int j = 0; j < robot.num_joints(); ++j) {
    const JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(j)].actuation;
    const auto of = [j](model::Robot& r) -> JointActuation<double>& {
      return r.joints[static_cast<std::size_t>(j)].actuation;
    };
    if (!places.rotor_inertia && actuation.rotor_inertia != 0.0)
      shares.add("rotor_inertia", j, [&](model::Robot& r) { of(r).rotor_inertia = 0.0; });
    if (actuation.friction_offset != 0.0)
      shares.add("friction_offset", j, [&](model::Robot& r) { of(r).friction_offset = 0.0; });
  }
  for (std::size_t k = 0; k < robot.effects.size(); ++k) {
    const JointEffect<double>& effect = robot.effects[k];
    if (places.spring && effect.kind == joint_effect_kind<Spring>()) continue;
    if (places.rotor_inertia && effect.kind == joint_effect_kind<RotorInertia>()) continue;
    std::string id;
    visit_joint_effect(effect.kind, [&](auto type) { id = decltype(type)::kId; });
    shares.add(id, effect.joint,
               [&](model::Robot& r) { r.effects.erase(r.effects.begin() + static_cast<std::ptrdiff_t>(k)); });
  }
  for (std::size_t k = 0; k < robot.couplings.size(); ++k) {
    shares.add("gear_coupling", robot.couplings[k].driven, [&](model::Robot& r) {
      r.couplings.erase(r.couplings.begin() + static_cast<std::ptrdiff_t>(k));
    });
  }
  for (std::size_t k = 0; k < robot.cables.size(); ++k) {
    shares.add("cable", robot.cables[k].driven, [&](model::Robot& r) {
      r.cables.erase(r.cables.begin() + static_cast<std::ptrdiff_t>(k));
    });
  }
  for (std::size_t k = 0; k < robot.elasticities.size(); ++k) {
    shares.add("elasticity", robot.elasticities[k].joint, [&](model::Robot& r) {
      r.elasticities.erase(r.elasticities.begin() + static_cast<std::ptrdiff_t>(k));
    });
  }
  if (robot.torque_delay != 0.0) shares.add("delay", -1, [](model::Robot& r) { r.torque_delay = 0.0; });
  if (!places.gravity && !is_level(robot.gravity))
    shares.add("gravity", -1, [](model::Robot& r) { r.gravity = {0.0, 0.0, -9.81}; });
  return shares.found;
}

}  // namespace heft::exchange
