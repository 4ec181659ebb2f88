#include "rival_torque.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/model/motion_torque.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Width of friction's sign [rad/s, m/s], as in every prediction that is judged.
constexpr double kSignWidth = 0.005;

double value_of(const Rival& rival, std::string_view name, double otherwise) {
  for (const auto& [key, value] : rival.parameters) {
    if (key == name && std::isfinite(value)) return value;
  }
  return otherwise;
}

JointEffect<double> effect_of(const Rival& rival) {
  JointEffect<double> effect;
  effect.kind = joint_effect_kind(rival.kind);
  effect.joint = rival.joint;
  visit_joint_effect(effect.kind, [&](auto type) {
    const auto& parameters = decltype(type)::kParameters;
    for (std::size_t i = 0; i < parameters.size(); ++i)
      effect.parameters[i] = value_of(rival, parameters[i].name, 0.0);
  });
  return effect;
}

/// Calls f(row, point) for every row of the motion of a joint; `effect` gives the memory.
template <typename F>
void for_each_point(const RivalMotion& motion, int joint, const JointEffect<double>& effect, F&& f) {
  double memory = 0.0;
  for (Index i = 0; i < motion.time.size(); ++i) {
    EffectPoint<double> point;
    point.time = motion.time[i];
    point.q = motion.at.q(i, joint);
    point.qd = motion.at.qd(i, joint);
    point.qdd = motion.at.qdd(i, joint);
    point.direction = velocity_sign(point.qd, kSignWidth);
    point.load = motion.load(i, joint);
    if (i > 0) memory = joint_effect_memory(effect, memory, point.q - motion.at.q(i - 1, joint));
    point.memory = memory;
    f(i, point);
  }
}

/// The shapes that a search over this motion would try.
template <typename Effect>
std::vector<double> shapes_of(Effect, const Rival& rival, const RivalMotion& motion) {
  if constexpr (Effect::kShapes.empty()) {
    return {0.0};
  } else {
    const ShapeRange& range = Effect::kShapes[0];
    const auto q = motion.at.q.col(rival.joint);
    double scale = 1.0;
    if (range.scale == ShapeScale::kTopSpeed) scale = motion.at.qd.col(rival.joint).cwiseAbs().maxCoeff();
    if (range.scale == ShapeScale::kTravel) scale = q.maxCoeff() - q.minCoeff();
    if (range.scale == ShapeScale::kDuration) scale = motion.time[motion.time.size() - 1];
    constexpr int kMostSteps = 16;
    const int steps = std::min(range.steps, kMostSteps);
    std::vector<double> shapes;
    for (int k = 0; k < steps; ++k) {
      const double at =
          range.from * std::pow(range.to / range.from, static_cast<double>(k) / std::max(1, steps - 1));
      shapes.push_back((range.whole ? std::round(at) : at) * scale);
    }
    // And the one that it was found with, whose name is the parameter that is no coefficient.
    for (const EffectParameter& parameter : Effect::kParameters) {
      const double found = value_of(rival, parameter.name, 0.0);
      const bool is_shape = parameter.range == EffectRange::kPositive;
      if (is_shape && found > 0.0) shapes.push_back(found);
    }
    return shapes;
  }
}

/// Torque of all joints with an elastic joint, or a late torque channel, less that without.
MatrixXd arm_torque(const model::Robot& robot, const Rival& rival, const RivalMotion& motion, double factor) {
  model::Robot with = robot, without = robot;
  std::erase_if(with.elasticities, [&](const auto& e) { return e.joint == rival.joint; });
  if (rival.kind == Delay::kId) {
    without.torque_delay = 0.0;
    with.torque_delay = value_of(rival, "delay", 0.0) * factor;
  } else {
    without = with;
    with.elasticities.push_back({rival.joint, value_of(rival, "stiffness", 0.0) / factor,
                                 value_of(rival, "damping", 0.0) / factor,
                                 value_of(rival, "motor_inertia", 0.0)});
  }
  model::MotionTorque a(with), b(without);
  return a.torque(motion.time, motion.at.q, motion.at.qd, motion.at.qdd, kSignWidth) -
         b.torque(motion.time, motion.at.q, motion.at.qd, motion.at.qdd, kSignWidth);
}

/// Smooth functions of position, velocity or load of a joint, m × functions, each with an rms of 1.
MatrixXd functions_of(const std::string& what, int joint, const RivalMotion& motion) {
  const VectorXd q = motion.at.q.col(joint), v = motion.at.qd.col(joint), load = motion.load.col(joint);
  const VectorXd sign = v.unaryExpr([](double x) { return velocity_sign(x, kSignWidth); });
  MatrixXd columns(q.size(), 6);
  if (what == "position") {
    const double reach = std::max(1e-9, q.maxCoeff() - q.minCoeff());
    const VectorXd turn = 2.0 * std::numbers::pi / reach * (q.array() - q.minCoeff());
    for (int k = 0; k < 3; ++k) {
      columns.col(2 * k) = (0.5 * (k + 1) * turn).array().sin();
      columns.col(2 * k + 1) = (0.5 * (k + 1) * turn).array().cos();
    }
  } else if (what == "velocity") {
    const VectorXd w = v / std::max(1e-9, v.cwiseAbs().maxCoeff());
    columns.col(0) = sign.array() * (-(w.array() / 0.05).square()).exp();
    columns.col(1) = sign.array() * (-(w.array() / 0.25).square()).exp();
    columns.col(2) = sign.array() * w.array().square();
    columns.col(3) = w.array().square();
    columns.col(4) = w.array().abs();
    columns.col(5) = w.array().cube();
  } else {
    const VectorXd l = load / std::max(1e-9, load.cwiseAbs().maxCoeff());
    columns.col(0) = sign.array() * l.array().abs();
    columns.col(1) = sign.array() * l.array().square();
    columns.col(2) = sign.array() * l.array();
    columns.col(3) = l.array().abs();
    columns.col(4) = l.array().square();
    columns.col(5) = l.array().cube();
  }
  for (Index c = 0; c < columns.cols(); ++c) {
    const double rms = std::sqrt(columns.col(c).squaredNorm() / static_cast<double>(columns.rows()));
    if (rms > 0.0) columns.col(c) /= rms;
  }
  return columns;
}

bool is_function(const std::string& kind) {
  return kind == "position" || kind == "velocity" || kind == "load";
}

MatrixXd in_joint(const RivalMotion& motion, int joint, const VectorXd& values) {
  MatrixXd torque = MatrixXd::Zero(motion.at.q.rows(), motion.at.q.cols());
  torque.col(joint) = values;
  return torque;
}

}  // namespace

bool is_separable(const std::string& kind) {
  // No motion sets a temperature.
  if (kind == FrictionTemperature::kId) return false;
  return joint_effect_kind(kind) >= 0 || kind == ElasticJoint::kId || kind == Delay::kId || is_function(kind);
}

RivalMotion rival_motion(const model::Dynamics& dynamics, Samples samples, double rate) {
  RivalMotion motion{std::move(samples), {}, {}};
  const Index m = motion.at.q.rows();
  motion.time = VectorXd::LinSpaced(m, 0.0, static_cast<double>(m - 1) / rate);
  motion.load.resize(m, motion.at.q.cols());
  for (Index i = 0; i < m; ++i) {
    motion.load.row(i) = dynamics.inverse_dynamics(
        motion.at.q.row(i).transpose(), motion.at.qd.row(i).transpose(), motion.at.qdd.row(i).transpose());
  }
  return motion;
}

std::vector<MatrixXd> own_torque(const model::Robot& robot, const Rival& rival, const RivalMotion& motion) {
  if (is_function(rival.kind)) {
    const MatrixXd columns = value_of(rival, "rms", 1.0) * functions_of(rival.kind, rival.joint, motion);
    std::vector<MatrixXd> torque;
    for (Index c = 0; c < columns.cols(); ++c)
      torque.push_back(in_joint(motion, rival.joint, columns.col(c)));
    return torque;
  }
  const JointEffect<double> effect = effect_of(rival);
  if (effect.kind < 0) return {arm_torque(robot, rival, motion, 1.0)};
  VectorXd torque(motion.time.size());
  const JointActuation<double>& actuation = robot.joints[static_cast<std::size_t>(rival.joint)].actuation;
  for_each_point(motion, rival.joint, effect, [&](Index i, const EffectPoint<double>& point) {
    torque[i] = joint_effect_torque(effect, point, actuation);
  });
  return {in_joint(motion, rival.joint, torque)};
}

std::vector<std::vector<MatrixXd>> family(const model::Robot& robot, const Rival& rival,
                                          const RivalMotion& motion) {
  if (is_function(rival.kind)) return {own_torque(robot, rival, motion)};
  JointEffect<double> effect = effect_of(rival);
  std::vector<std::vector<MatrixXd>> shapes;
  if (effect.kind < 0) {
    // Nearly linear in what gives: three compliances (or delays) about the one that was found. The inertia of the motor is
    // in everybody's fit.
    for (const double factor : {0.5, 1.0, 2.0}) shapes.push_back({arm_torque(robot, rival, motion, factor)});
    return shapes;
  }
  visit_joint_effect(effect.kind, [&](auto type) {
    using Effect = decltype(type);
    constexpr auto kColumns = static_cast<Index>(Effect::kNotNegative.size());
    for (const double shape : shapes_of(type, rival, motion)) {
      if constexpr (EffectWithMemory<Effect>) effect.parameters[0] = shape;
      MatrixXd columns(motion.time.size(), kColumns);
      for_each_point(motion, rival.joint, effect, [&](Index i, const EffectPoint<double>& point) {
        const auto row = Effect::columns(shape, point);
        for (Index c = 0; c < kColumns; ++c) columns(i, c) = row[static_cast<std::size_t>(c)];
      });
      std::vector<MatrixXd> set;
      for (Index c = 0; c < kColumns; ++c) set.push_back(in_joint(motion, rival.joint, columns.col(c)));
      shapes.push_back(std::move(set));
    }
  });
  return shapes;
}

}  // namespace heft::excite
