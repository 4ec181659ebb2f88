#include "fitted_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"

namespace heft::compare {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using regression::ColumnKind;

Kind kind_of(ColumnKind kind) {
  switch (kind) {
    case ColumnKind::kLink: return Kind::kLink;
    case ColumnKind::kRotorInertia: return Kind::kRotorInertia;
    case ColumnKind::kCoulomb: return Kind::kCoulomb;
    case ColumnKind::kViscous: return Kind::kViscous;
    case ColumnKind::kOffset: return Kind::kOffset;
    default: return Kind::kCoupling;
  }
}

double freedom_of(double std, double half_width) {
  return std > 0.0 && std::isfinite(half_width) ? statistics::degrees_of_freedom(half_width / std) : kNaN;
}

/// The shape of an effect, the one parameter of it that has to be above zero; 0 for one that has none.
double shape_of(const JointEffect<double>& effect) {
  double shape = 0.0;
  visit_joint_effect(effect.kind, [&](auto type) {
    const auto& parameters = decltype(type)::kParameters;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const bool from_log = std::is_same_v<decltype(type), FrictionTemperature> && parameters[i].name == "T0";
      if (from_log || parameters[i].range == EffectRange::kPositive) shape = effect.parameters[i];
    }
  });
  return shape;
}

model::Robot robot_of(const model::ModelFile& file) {
  if (!file.kinematics) {
    throw ModelError(fmt::format(
        "{}: /kinematics: missing; expected the joint frames of robot \"{}\"; fit the model again with this version of heft",
        name_of(file), file.robot));
  }
  if (!file.fit || file.fit->base_parameters.empty()) {
    throw ModelError(fmt::format(
        "{}: /fit/base_parameters: missing; expected parameters with intervals, as heft identify and heft diagnose "
        "write them; fit the model to logs again",
        name_of(file)));
  }
  return model::make_robot(file);
}

}  // namespace

bool is_friction_of_speed(int kind) {
  return kind == joint_effect_kind<Stribeck>() || kind == joint_effect_kind<ViscousNonlinear>() ||
         kind == joint_effect_kind<LoadFriction>() || kind == joint_effect_kind<FrictionDrift>() ||
         kind == joint_effect_kind<FrictionTemperature>() ||
         kind == joint_effect_kind<heft::FrictionCurve>();
}

std::string name_of(const model::ModelFile& file) { return file.path.empty() ? "model" : file.path; }

double fastest(const model::RobotJoint& joint) {
  constexpr double kWithoutLimit = 2.0;  // [rad/s, m/s]
  return 0.5 * (std::isfinite(joint.velocity_limit) && joint.velocity_limit > 0.0 ? joint.velocity_limit
                                                                                  : kWithoutLimit);
}

std::vector<State> reference_states(const model::Robot& robot) {
  constexpr int kStates = 200;
  constexpr double kToSpeed = 0.5;  // [s]
  std::mt19937_64 random(1);
  const auto uniform = [&] { return 2.0 * std::ldexp(static_cast<double>(random() >> 11U), -53) - 1.0; };
  const Index n = robot.num_joints();
  std::vector<State> states(kStates, {VectorXd(n), VectorXd(n), VectorXd(n)});
  for (State& state : states) {
    for (Index j = 0; j < n; ++j) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      const double reach = joint.joint.type == JointType::kPrismatic ? 1.0 : std::numbers::pi;
      const double low = std::max(joint.lower, -reach), high = std::min(joint.upper, reach);
      state.q[j] = 0.5 * (low + high) + 0.5 * (high - low) * uniform();
      state.qd[j] = fastest(joint) * uniform();
      state.qdd[j] = fastest(joint) / kToSpeed * uniform();
    }
  }
  return states;
}

FittedModel::FittedModel(const model::ModelFile& file)
    : dynamics_(robot_of(file)),
      columns_(dynamics_.robot(), {true, true, true, true, dynamics_.robot().couplings}),
      covariance_(file.fit->parameter_covariance) {
  for (const model::BaseParameterRecord& record : file.fit->base_parameters) {
    Parameter p;
    p.name = record.name;
    p.meaning = record.expression;
    p.unit = record.unit;
    p.value = record.value;
    p.std = record.std;
    p.freedom = freedom_of(record.std, record.half_width);
    p.determined = record.determined;
    const std::string bare = record.name.substr(0, record.name.find('*'));
    for (int c = 0; c < columns_.count(); ++c) {
      if (columns_[c].name != bare) continue;
      p.column = c;
      p.kind = kind_of(columns_[c].kind);
      p.joint = columns_[c].joint;
    }
    parameters_.push_back(std::move(p));
  }
  for (const model::EffectCoefficientRecord& record : file.fit->effect_coefficients) {
    if (record.effect < 0 || record.effect >= static_cast<int>(robot().effects.size())) {
      throw ModelError(fmt::format(
          "{}: /fit/effect_coefficients: found effect {}; expected 1 to {}, as /effects has; fit the "
          "model again",
          name_of(file), record.effect + 1, robot().effects.size()));
    }
    const JointEffect<double>& effect = robot().effects[static_cast<std::size_t>(record.effect)];
    Parameter p;
    p.kind = Kind::kEffect;
    p.joint = effect.joint;
    p.effect = record.effect;
    p.coefficient = record.coefficient;
    visit_joint_effect(effect.kind, [&](auto type) {
      p.name =
          fmt::format("{} {} of joint {}", decltype(type)::kId, record.coefficient + 1, effect.joint + 1);
    });
    p.value = record.value;
    p.std = record.std;
    p.freedom = freedom_of(record.std, record.half_width);
    parameters_.push_back(std::move(p));
  }
  temperature_ = VectorXd::Constant(robot().num_joints(), kNaN);
  const model::FitRecord& fit = *file.fit;
  largest_torque_ = VectorXd::Constant(robot().num_joints(), kNaN);
  if (fit.rmse.size() == largest_torque_.size() && fit.rmse_percent_of_max.size() == largest_torque_.size())
    largest_torque_ = 100.0 * fit.rmse.cwiseQuotient(fit.rmse_percent_of_max);
}

const Parameter* FittedModel::find(const std::string& name) const {
  const auto found = std::find_if(parameters_.begin(), parameters_.end(),
                                  [&](const Parameter& p) { return p.name == name; });
  return found == parameters_.end() ? nullptr : &*found;
}

double FittedModel::variance(const VectorXd& gradient) const {
  if (!has_covariance()) return kNaN;
  double sum = 0.0;
  for (Index r = 0; r < gradient.size(); ++r) {
    for (Index c = 0; c < gradient.size(); ++c) {  // entries that do not count may be unknown
      if (gradient[r] != 0.0 && gradient[c] != 0.0) sum += gradient[r] * gradient[c] * covariance_(r, c);
    }
  }
  return std::isnan(sum) ? kNaN : std::max(0.0, sum);
}

EffectPoint<double> FittedModel::point_of(int joint, const State& state) const {
  EffectPoint<double> point;
  point.temperature = temperature_[joint];
  point.q = state.q[joint];
  point.qd = state.qd[joint];
  point.qdd = state.qdd[joint];
  point.direction = state.qd[joint] > 0.0 ? 1.0 : state.qd[joint] < 0.0 ? -1.0 : 0.0;
  point.memory = point.direction;  // friction has turned over
  point.load = dynamics_.inverse_dynamics(state.q, state.qd, state.qdd)[joint];
  return point;
}

double FittedModel::effect_column(const Parameter& parameter, const EffectPoint<double>& point) const {
  const JointEffect<double>& effect = robot().effects[static_cast<std::size_t>(parameter.effect)];
  double value = 0.0;
  visit_joint_effect(effect.kind, [&](auto type) {
    const auto row = decltype(type)::columns(shape_of(effect), point);
    if (parameter.coefficient < static_cast<int>(row.size()))
      value = row[static_cast<std::size_t>(parameter.coefficient)];
  });
  return value;
}

VectorXd FittedModel::torque(Part part, const State& s) const {
  const VectorXd gravity = dynamics_.gravity_torque(s.q);
  VectorXd offset(gravity.size());
  for (Index j = 0; j < offset.size(); ++j)
    offset[j] = robot().joints[static_cast<std::size_t>(j)].actuation.friction_offset;
  // Cables pull in the torque at rest.
  VectorXd pull = VectorXd::Zero(gravity.size());
  for (const JointCable<double>& cable : robot().cables) add_cable(cable, s.q, pull);
  if (part == Part::kStatic) return gravity + offset + pull;
  VectorXd inertia = dynamics_.inverse_dynamics(s.q, s.qd, s.qdd) - gravity;
  for (Index j = 0; j < inertia.size(); ++j)
    inertia[j] += robot().joints[static_cast<std::size_t>(j)].actuation.rotor_inertia * s.qdd[j];
  for (const Elasticity<double>& elastic : robot().elasticities)
    inertia[elastic.joint] += elastic.motor_inertia * s.qdd[elastic.joint];
  if (part == Part::kInertia) return inertia;
  VectorXd friction = dynamics_.joint_torque(s.q, s.qd, s.qdd) - gravity - inertia - offset - pull;
  // joint_torque() knows no temperature.
  for (const JointEffect<double>& effect : robot().effects) {
    if (effect.kind != joint_effect_kind<FrictionTemperature>()) continue;
    friction[effect.joint] +=
        joint_effect_torque(effect, point_of(effect.joint, s),
                            robot().joints[static_cast<std::size_t>(effect.joint)].actuation);
  }
  return friction;
}

MatrixXd FittedModel::rows(Part part, const State& s) const {
  const VectorXd still = VectorXd::Zero(s.q.size());
  const MatrixXd gravity = columns_.regressor(s.q, still, still), all = columns_.regressor(s.q, s.qd, s.qdd);
  MatrixXd rows = MatrixXd::Zero(s.q.size(), static_cast<Index>(parameters_.size()));
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    const Parameter& p = parameters_[k];
    const auto at = static_cast<Index>(k);
    if (p.kind == Kind::kEffect) {
      if (part == Part::kFriction) rows(p.joint, at) = effect_column(p, point_of(p.joint, s));
    } else if (p.column >= 0 && p.kind == Kind::kLink) {
      if (part == Part::kStatic) rows.col(at) = gravity.col(p.column);
      if (part == Part::kInertia) rows.col(at) = all.col(p.column) - gravity.col(p.column);
    } else if (p.column >= 0) {
      const Part of = p.kind == Kind::kOffset         ? Part::kStatic
                      : p.kind == Kind::kRotorInertia ? Part::kInertia
                                                      : Part::kFriction;
      if (part == of) rows.col(at) = all.col(p.column);
    }
  }
  return rows;
}

VectorXd FittedModel::column(const Parameter& p, const State& s) const {
  VectorXd column = VectorXd::Zero(s.q.size());
  if (p.kind == Kind::kEffect) {
    column[p.joint] = effect_column(p, point_of(p.joint, s));
  } else if (p.column >= 0) {
    column = columns_.regressor(s.q, s.qd, s.qdd).col(p.column);
  }
  return column;
}

double FittedModel::friction(int joint, double speed, double load, VectorXd* gradient) const {
  EffectPoint<double> point;
  point.temperature = temperature_[joint];
  point.qd = speed;
  point.direction = 1.0;
  point.memory = 1.0;
  point.load = load;
  if (gradient != nullptr) {
    gradient->setZero(static_cast<Index>(parameters_.size()));
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
      const Parameter& p = parameters_[k];
      double& slope = (*gradient)[static_cast<Index>(k)];
      if (p.joint != joint) continue;
      if (p.kind == Kind::kCoulomb) slope = 1.0;
      if (p.kind == Kind::kViscous) slope = speed;
      if (p.kind == Kind::kEffect &&
          is_friction_of_speed(robot().effects[static_cast<std::size_t>(p.effect)].kind))
        slope = effect_column(p, point);
    }
  }
  const JointActuation<double>& actuation = robot().joints[static_cast<std::size_t>(joint)].actuation;
  double torque = actuation.coulomb_friction + actuation.viscous_friction * speed;
  for (const JointEffect<double>& effect : robot().effects) {
    if (effect.joint == joint && is_friction_of_speed(effect.kind))
      torque += joint_effect_torque(effect, point, actuation);
  }
  return torque;
}

double FittedModel::own_temperature(int joint) const {
  for (const JointEffect<double>& effect : robot().effects) {
    if (effect.joint == joint && effect.kind == joint_effect_kind<FrictionTemperature>())
      return shape_of(effect);
  }
  return kNaN;
}

bool FittedModel::has_other_friction(int joint) const {
  return std::any_of(robot().effects.begin(), robot().effects.end(), [&](const JointEffect<double>& effect) {
    return effect.joint == joint && is_friction_of_speed(effect.kind);
  });
}

bool FittedModel::has_effect(int joint, std::initializer_list<int> kinds) const {
  return std::any_of(robot().effects.begin(), robot().effects.end(), [&](const JointEffect<double>& effect) {
    return effect.joint == joint && std::find(kinds.begin(), kinds.end(), effect.kind) != kinds.end();
  });
}

std::set<std::pair<int, int>> FittedModel::cables_of(int joint) const {
  std::set<std::pair<int, int>> all;
  for (const JointCable<double>& cable : robot().cables) {
    if (cable.driving == joint || cable.driven == joint) all.emplace(cable.driving, cable.driven);
  }
  return all;
}

VectorXd bring_to_one_temperature(const std::vector<FittedModel*>& models) {
  VectorXd temperature = VectorXd::Constant(models.front()->robot().num_joints(), kNaN);
  for (Index j = 0; j < temperature.size(); ++j) {
    double sum = 0.0, known = 0.0;
    for (const FittedModel* model : models) {
      const double own = model->own_temperature(static_cast<int>(j));
      if (std::isfinite(own)) sum += own, known += 1.0;
    }
    if (known > 0.0) temperature[j] = sum / known;
  }
  for (FittedModel* model : models) model->set_temperature(temperature);
  return temperature;
}

}  // namespace heft::compare
