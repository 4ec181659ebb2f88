#include "plant.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

namespace heft::sim {
namespace {

/// A stuck joint starts when the load exceeds its level by this factor: more than rounding, so that it then
/// moves away from rest with certainty, and less than any level is known.
constexpr double kReleaseMargin = 1.0 + 1e-9;

[[noreturn]] void refuse(const std::string& what, const std::string& found, const std::string& expected) {
  throw ModelError(
      fmt::format("simulation: {}: found {}, expected {}; correct it in the robot", what, found, expected));
}

/// The arm without what does not ride on the rigid bodies: rotors of elastic joints. Rotor inertias among
/// the effects become the joint's.
model::Robot bodies_of(model::Robot robot) {
  const int n = robot.num_joints();
  for (const heft::JointEffect<double>& effect : robot.effects) {
    if (effect.kind != joint_effect_kind<RotorInertia>()) continue;
    if (effect.joint < 0 || effect.joint >= n) {
      refuse("effects", fmt::format("joint {}", effect.joint + 1), fmt::format("1 to {}", n));
    }
    robot.joints[static_cast<std::size_t>(effect.joint)].actuation.rotor_inertia += effect.parameters[0];
  }
  std::vector<bool> seen(static_cast<std::size_t>(n), false);
  for (Elasticity<double>& e : robot.elasticities) {
    if (e.joint < 0 || e.joint >= n || seen[static_cast<std::size_t>(e.joint)]) {
      refuse("elasticities", fmt::format("joint {}", e.joint + 1),
             fmt::format("joints from 1 to {}, each once", n));
    }
    seen[static_cast<std::size_t>(e.joint)] = true;
    double& rotor = robot.joints[static_cast<std::size_t>(e.joint)].actuation.rotor_inertia;
    e.motor_inertia += rotor;
    rotor = 0.0;
    if (!(e.stiffness > 0.0 && e.motor_inertia > 0.0 && e.damping >= 0.0 && e.gap >= 0.0)) {
      refuse(fmt::format("elasticities, joint {}", e.joint + 1),
             fmt::format("stiffness {}, motor inertia {}, damping {}, gap {}", e.stiffness, e.motor_inertia,
                         e.damping, e.gap),
             "stiffness and motor inertia above 0, damping and gap at least 0");
    }
  }
  for (const GearCoupling<double>& c : robot.couplings) {
    if (c.driving < 0 || c.driving >= n || c.driven < 0 || c.driven >= n || c.driving == c.driven) {
      refuse("couplings", fmt::format("joints {} and {}", c.driving + 1, c.driven + 1),
             fmt::format("two joints from 1 to {}", n));
    }
  }
  return robot;
}

}  // namespace

Plant::Plant(const SimulationSettings& settings) : Plant(settings, bodies_of(settings.robot)) {}

Plant::Plant(const SimulationSettings& settings, const model::Robot& robot)
    : n_(robot.num_joints()),
      dynamics_(robot),
      elastic_(robot.elasticities),
      cables_(robot.cables),
      coupling_smooth_speed_(settings.coupling_smooth_speed),
      limit_(settings.torque_limit),
      held_(Eigen::VectorXd::Zero(n_)),
      motor_(Eigen::VectorXd::Zero(n_)),
      torque_function_(settings.controller == nullptr ? settings.torque : nullptr),
      wrench_(settings.tool_wrench),
      gravity_(settings.gravity_of_time),
      disturbance_(settings.disturbance),
      disturbance_torque_(Eigen::VectorXd::Zero(n_)) {
  if (settings.gravity) dynamics_.set_gravity(*settings.gravity);
  const auto n = static_cast<std::size_t>(n_);
  loads_.resize(n);
  is_dry_.assign(n, false);
  mode_.assign(n, 1);
  locked_ = std::make_unique<bool[]>(n);
  locked_bodies_ = std::make_unique<bool[]>(n);
  net_.assign(n, 0.0);
  qdd_.assign(n + elastic_.size(), 0.0);
  link_q_.assign(n, 0.0);
  link_qd_.assign(n, 0.0);
  link_torque_.assign(n, 0.0);
  for (const GearCoupling<double>& gear : robot.couplings) {
    couplings_.push_back(gear);
    coupled_rotors_ = coupled_rotors_ || gear.rotor_inertia != 0.0;
  }
  excess_.assign(n, 0.0);
  friction_.assign(n, 0.0);
  for (std::size_t i = 0; i < settings.loads.size(); ++i) {
    loads_[i].load = settings.loads[i];
    for (const auto& effect : loads_[i].load.effects) {
      loads_[i].state_offset.push_back(num_extra_);
      num_extra_ += effect->num_states();
      loads_[i].load_share += effect->load_share();
      loads_[i].load_gain += effect->load_gain();
    }
    if (!(loads_[i].load_share >= 0.0 && loads_[i].load_share < 1.0)) {
      refuse(fmt::format("load friction of joint {}", i + 1), fmt::format("{}", loads_[i].load_share),
             "at least 0 and below 1");
    }
    // Otherwise the motor would have to turn with its load.
    if (!(1.0 + loads_[i].load_gain - loads_[i].load_share > 0.0)) {
      refuse(fmt::format("torque scale of joint {}", i + 1), fmt::format("{}", loads_[i].load_gain),
             "more than load friction less 1");
    }
  }
  for (std::size_t k = 0; k < elastic_.size(); ++k) {
    loads_[static_cast<std::size_t>(elastic_[k].joint)].elastic = static_cast<int>(k);
  }
  for (int i = 0; i < n_; ++i) {
    const Load& load = loads_[static_cast<std::size_t>(i)];
    if ((load.load_share > 0.0 || load.load_gain != 0.0) && load.elastic < 0)
      loaded_.push_back({i, dynamics_.rotor_inertia(i), 0.0, load.load_gain, 1.0});
  }
  std::vector<double> z(static_cast<std::size_t>(num_extra_) + 1, 0.0);
  Eigen::VectorXd qd = settings.initial_velocity;
  if (qd.size() == 0) qd = Eigen::VectorXd::Zero(n_);
  initial_extra(0.0, settings.initial_position.data(), qd.data(), z.data());
  for (std::size_t i = 0; i < n; ++i) {
    if (loads_[i].load.sign != SignModel::kStickSlip || loads_[i].load.effects.empty()) continue;
    const double* q = settings.initial_position.data();
    is_dry_[i] = loads_[i].load_share > 0.0 ||
                 std::max(level(i, 1, 0.0, 0.0, q, z.data()), level(i, -1, 0.0, 0.0, q, z.data())) > 0.0;
    if (!is_dry_[i]) continue;
    dry_.push_back(static_cast<int>(i));
    const double velocity = qd[static_cast<Eigen::Index>(i)];
    mode_[i] = velocity > 0.0 ? 1 : velocity < 0.0 ? -1 : 0;
  }
  relock();
}

void Plant::relock() {
  num_stuck_ = 0;
  for (std::size_t i = 0; i < mode_.size(); ++i) {
    locked_[i] = is_dry_[i] && mode_[i] == 0;
    locked_bodies_[i] = locked_[i];
    num_stuck_ += locked_[i] ? 1 : 0;
  }
  for (const Elasticity<double>& e : elastic_) locked_bodies_[static_cast<std::size_t>(e.joint)] = false;
}

double Plant::temperature(std::size_t joint, double t) const {
  const std::optional<Warming>& warming = loads_[joint].load.temperature;
  return warming ? warming->at(t) : std::numeric_limits<double>::quiet_NaN();
}

JointPoint Plant::point(std::size_t joint, double t, const double* q, const double* qd) const {
  const JointLoad& load = loads_[joint].load;
  double direction = 0.0;
  if (is_dry_[joint]) {
    direction = mode_[joint];
  } else if (load.sign == SignModel::kSmooth) {
    direction = std::tanh(qd[joint] / load.smooth_speed);
  } else {
    direction = qd[joint] > 0.0 ? 1.0 : qd[joint] < 0.0 ? -1.0 : 0.0;
  }
  return {t, q[joint], qd[joint], direction, 0.0, temperature(joint, t)};
}

double Plant::level(std::size_t joint, int direction, double passed, double t, const double* q,
                    const double* z) const {
  const JointPoint rest{t, q[joint], 0.0, 0.0, passed, temperature(joint, t)};
  double sum = 0.0;
  const Load& load = loads_[joint];
  for (std::size_t k = 0; k < load.load.effects.size(); ++k) {
    sum += load.load.effects[k]->breakaway(rest, direction, z + load.state_offset[k]);
  }
  return std::max(0.0, sum);
}

const Eigen::VectorXd& Plant::motor_torque(double t) {
  if (!torque_function_) return held_;
  motor_.setZero();
  torque_function_(t, motor_);
  if (limit_.size() > 0) motor_ = motor_.cwiseMin(limit_).cwiseMax(-limit_);
  return motor_;
}

void Plant::accelerations(double t, const double* q, const double* qd, const double* z) {
  const double* torque = motor_torque(t).data();
  disturbance_torque_.setZero();
  if (disturbance_) {
    disturbance_(t, Eigen::Map<const Eigen::VectorXd>(q, n_), Eigen::Map<const Eigen::VectorXd>(qd, n_),
                 disturbance_torque_);
  }
  for (const GearCoupling<double>& c : couplings_) {
    const double v = shared_motion(c, qd[c.driving], qd[c.driven]);
    const double shared = c.coulomb_friction * std::tanh(v / coupling_smooth_speed_) + c.viscous_friction * v;
    disturbance_torque_[c.driven] += shared;
    disturbance_torque_[c.driving] += c.ratio * shared;
  }
  for (const JointCable<double>& c : cables_) add_cable(c, q, disturbance_torque_);
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const Load& load = loads_[i];
    double sum = disturbance_torque_[static_cast<Eigen::Index>(i)];
    if (!load.load.effects.empty()) {
      const JointPoint at = point(i, t, q, qd);
      for (std::size_t k = 0; k < load.load.effects.size(); ++k) {
        sum += load.load.effects[k]->torque(at, z + load.state_offset[k]);
      }
      // Its bodies get the torque of the spring of an elastic joint.
      if (load.elastic >= 0 && (load.load_share > 0.0 || load.load_gain != 0.0)) {
        const double passed_on = spring_torque(load.elastic, q, qd);
        sum += load.load_share * std::abs(passed_on) * at.direction + load.load_gain * passed_on;
      }
    }
    friction_[i] = sum;
    net_[i] = torque[i] - sum;
  }
  if (gravity_) dynamics_.set_gravity(gravity_(t));
  if (loaded_.empty()) {
    solve(t, q, qd);
  } else {
    solve_with_load_friction(t, q, qd, torque);
  }
}

void Plant::solve(double t, const double* q, const double* qd) {
  solve_bodies(t, q, qd);
  if (coupled_rotors_) add_coupling_rotors(t, q, qd);
}

void Plant::solve_with_load_friction(double t, const double* q, const double* qd, const double* torque) {
  // L + I q̈ + μ|L|s + gL = T with T = τ − all other. With σ the sign of L and d = 1 + g + μ s σ > 0 this is the
  // equation of a joint without load friction, L + (I/d) q̈ = T/d. Without a rotor σ is the sign of T.
  const std::vector<double> rest = net_;
  for (LoadedJoint& joint : loaded_) {
    const auto i = static_cast<std::size_t>(joint.joint);
    joint.side = rest[i] < 0.0 ? -1.0 : 1.0;
    joint.along = loads_[i].load_share * point(i, t, q, qd).direction;
  }
  constexpr int kPasses = 4;
  for (int pass = 0; pass < kPasses; ++pass) {
    net_ = rest;
    for (const LoadedJoint& joint : loaded_) {
      const double d = 1.0 + joint.gain + joint.along * joint.side;
      net_[static_cast<std::size_t>(joint.joint)] /= d;
      dynamics_.set_rotor_inertia(joint.joint, joint.rotor / d);
    }
    solve(t, q, qd);
    bool turned = false;
    for (LoadedJoint& joint : loaded_) {
      const auto i = static_cast<std::size_t>(joint.joint);
      const double d = 1.0 + joint.gain + joint.along * joint.side;
      const double load = (rest[i] - joint.rotor * qdd_[i]) / d;
      friction_[i] = torque[i] - load - joint.rotor * qdd_[i];
      // A stuck joint has no such friction.
      if (load * joint.side < 0.0 && joint.along != 0.0) {
        joint.side = -joint.side;
        turned = true;
      }
    }
    if (!turned) break;
  }
  for (const LoadedJoint& joint : loaded_) dynamics_.set_rotor_inertia(joint.joint, joint.rotor);
}

double Plant::spring_torque(int k, const double* q, const double* qd) const {
  const Elasticity<double>& e = elastic_[static_cast<std::size_t>(k)];
  const int link = n_ + k;
  return heft::spring_torque(e, q[e.joint] - q[link], qd[e.joint] - qd[link]);
}

void Plant::solve_bodies(double t, const double* q, const double* qd) {
  Wrench wrench;
  if (wrench_) wrench = wrench_(t);
  const Wrench* outer = wrench_ ? &wrench : nullptr;
  const bool* locked = num_stuck_ > 0 ? locked_bodies_.get() : nullptr;
  double* excess = num_stuck_ > 0 ? excess_.data() : nullptr;
  if (elastic_.empty()) {
    dynamics_.acceleration(q, qd, net_.data(), locked, outer, qdd_.data(), excess);
    return;
  }
  std::copy(q, q + n_, link_q_.begin());
  std::copy(qd, qd + n_, link_qd_.begin());
  std::copy(net_.begin(), net_.end(), link_torque_.begin());
  for (std::size_t k = 0; k < elastic_.size(); ++k) {
    const Elasticity<double>& e = elastic_[k];
    const auto i = static_cast<std::size_t>(e.joint);
    const std::size_t link = static_cast<std::size_t>(n_) + k;
    link_q_[i] = q[link];
    link_qd_[i] = qd[link];
    // K (θ − x) + D (θ̇ − ẋ) drives the bodies.
    link_torque_[i] = spring_torque(static_cast<int>(k), q, qd);
  }
  dynamics_.acceleration(link_q_.data(), link_qd_.data(), link_torque_.data(), locked, outer, qdd_.data(),
                         excess);
  for (std::size_t k = 0; k < elastic_.size(); ++k) {
    const Elasticity<double>& e = elastic_[k];
    const auto i = static_cast<std::size_t>(e.joint);
    qdd_[static_cast<std::size_t>(n_) + k] = qdd_[i];
    // J θ̈ = τ − friction − spring
    const double left = net_[i] - link_torque_[i];
    qdd_[i] = locked_[i] ? 0.0 : left / e.motor_inertia;
    excess_[i] = locked_[i] ? left : 0.0;
  }
}

void Plant::add_coupling_rotors(double t, const double* q, const double* qd) {
  // The rotor k feels c·q̈ with c = (1 at driven, r at driving) and takes the torque T_k c_k. Accelerations
  // are affine in the torque: q̈ = a − Σ u_j T_j with u_j what a shared torque of 1 brings about, and
  //   T_k / I_k + Σ c_k·u_j T_j = c_k·a.
  const auto shared = [&](const GearCoupling<double>& c, const auto& a) {
    return a[static_cast<std::size_t>(c.driven)] + c.ratio * a[static_cast<std::size_t>(c.driving)];
  };
  const auto add = [&](const GearCoupling<double>& c, double torque) {
    net_[static_cast<std::size_t>(c.driven)] += torque;
    net_[static_cast<std::size_t>(c.driving)] += c.ratio * torque;
  };
  const std::vector<double> net = net_;
  const std::vector<double> free = qdd_;
  const auto count = static_cast<Eigen::Index>(couplings_.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd b(count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const GearCoupling<double>& c = couplings_[static_cast<std::size_t>(j)];
    b[j] = shared(c, free);
    add(c, 1.0);
    solve_bodies(t, q, qd);
    net_ = net;
    for (std::size_t i = 0; i < free.size(); ++i) qdd_[i] -= free[i];
    for (Eigen::Index k = 0; k < count; ++k) {
      const GearCoupling<double>& other = couplings_[static_cast<std::size_t>(k)];
      // Times I_k, so that a rotor without inertia gives T_k = 0.
      A(k, j) = (k == j ? 1.0 : 0.0) + other.rotor_inertia * shared(other, qdd_);
    }
  }
  for (Eigen::Index k = 0; k < count; ++k) b[k] *= couplings_[static_cast<std::size_t>(k)].rotor_inertia;
  const Eigen::VectorXd torque = solve_square(A, b);
  for (Eigen::Index k = 0; k < count; ++k) add(couplings_[static_cast<std::size_t>(k)], -torque[k]);
  solve_bodies(t, q, qd);
}

void Plant::settle_links(double t, double* q, double* qd) {
  if (elastic_.empty()) return;
  if (gravity_) dynamics_.set_gravity(gravity_(t));
  Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(q, n_);
  // x = θ − g(x)/K − sign(g(θ)) gap/2, a contraction for any spring that holds its arm. The side is that of the motor's
  // position: within the play gravity may turn over, and the passes would go back and forth.
  const Eigen::VectorXd side = dynamics_.gravity_torque(x).cwiseSign();
  for (int pass = 0; pass < 200; ++pass) {
    const Eigen::VectorXd gravity = dynamics_.gravity_torque(x);
    for (const Elasticity<double>& e : elastic_)
      x[e.joint] = q[e.joint] - gravity[e.joint] / e.stiffness - 0.5 * side[e.joint] * e.gap;
  }
  for (std::size_t k = 0; k < elastic_.size(); ++k) {
    q[static_cast<std::size_t>(n_) + k] = x[elastic_[k].joint];
    qd[static_cast<std::size_t>(n_) + k] = qd[elastic_[k].joint];
  }
}

Eigen::VectorXd Plant::link_side(const Eigen::VectorXd& values) const {
  Eigen::VectorXd links = values.head(n_);
  for (std::size_t k = 0; k < elastic_.size(); ++k)
    links[elastic_[k].joint] = values[n_ + static_cast<int>(k)];
  return links;
}

double Plant::kinetic_energy(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const {
  double energy = dynamics_.kinetic_energy(link_side(q), link_side(qd));
  for (const Elasticity<double>& e : elastic_) energy += 0.5 * e.motor_inertia * qd[e.joint] * qd[e.joint];
  for (const GearCoupling<double>& c : couplings_) {
    const double v = shared_motion(c, qd[c.driving], qd[c.driven]);
    energy += 0.5 * c.rotor_inertia * v * v;
  }
  return energy;
}

double Plant::potential_energy(const Eigen::VectorXd& q) const {
  const Eigen::VectorXd x = link_side(q);
  double energy = dynamics_.potential_energy(x);
  for (const Elasticity<double>& e : elastic_) {
    const double stretch = bent(q[e.joint] - x[e.joint], e.gap);
    energy += 0.5 * e.stiffness * stretch * stretch;
  }
  for (const JointCable<double>& c : cables_) {
    const double stretch = q[c.driven] + c.ratio * q[c.driving] - c.neutral;
    energy += 0.5 * c.stiffness * stretch * stretch;
  }
  return energy;
}

void Plant::evaluate(double t, const double* q, const double* qd, const double* z, double* qdd, double* zd) {
  accelerations(t, q, qd, z);
  std::copy(qdd_.begin(), qdd_.end(), qdd);
  if (num_extra_ == 0) return;
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const Load& load = loads_[i];
    const JointPoint at = point(i, t, q, qd);
    for (std::size_t k = 0; k < load.load.effects.size(); ++k) {
      load.load.effects[k]->rate(at, z + load.state_offset[k], zd + load.state_offset[k]);
    }
  }
}

void Plant::roots(double t, const double* q, const double* qd, const double* z, double* g) {
  if (num_stuck_ > 0) accelerations(t, q, qd, z);
  roots_there(t, q, qd, z, g);
}

void Plant::roots_there(double t, const double* q, const double* qd, const double* z, double* g) {
  for (std::size_t k = 0; k < dry_.size(); ++k) {
    const auto i = static_cast<std::size_t>(dry_[k]);
    if (locked_[i]) {
      const double load = excess_[i];
      g[k] = level(i, load >= 0.0 ? 1 : -1, load_at_rest(i), t, q, z) * kReleaseMargin - std::abs(load);
    } else {
      g[k] = mode_[i] * qd[i];
    }
  }
  double& trigger = g[dry_.size()];
  trigger = trigger_joint_ < 0 ? 1.0 : trigger_side_ * (q[trigger_joint_] - trigger_position_);
}

void Plant::arm_trigger(int joint, double position, double q) {
  trigger_joint_ = joint;
  trigger_position_ = position;
  trigger_side_ = q >= position ? 1.0 : -1.0;
}

bool Plant::resolve_modes(double t, const double* q, double* qd, const double* z) {
  const std::vector<int> before = mode_;
  std::vector<int> resting;
  for (int joint : dry_) {
    const auto i = static_cast<std::size_t>(joint);
    if (mode_[i] != 0 && mode_[i] * qd[i] <= 0.0) qd[i] = 0.0;
    if (qd[i] == 0.0) {
      mode_[i] = 0;
      resting.push_back(joint);
    }
  }
  relock();
  if (resting.empty()) return mode_ != before;
  // The accelerations from rest minimise ½ aᵀM a − aᵀ(τ − h) + Σ F|a|, which is convex; this is its active-set
  // descent (see integrator.md). All resting joints are held first; the most overloaded is let go; where the
  // way to the new accelerations turns a joint around, the way ends there and that joint is held again.
  std::vector<double> reached(static_cast<std::size_t>(n_), 0.0);
  for (std::size_t pass = 0; pass < 10 * resting.size() + 10; ++pass) {
    accelerations(t, q, qd, z);
    double share = 1.0;
    int blocked = -1;
    for (int joint : resting) {
      const auto i = static_cast<std::size_t>(joint);
      const double target = mode_[i] * qdd_[i];
      if (mode_[i] == 0 || target >= 0.0) continue;
      const double here = mode_[i] * reached[i];
      const double until_zero = here / (here - target);
      if (until_zero < share) {
        share = until_zero;
        blocked = joint;
      }
    }
    for (int joint : resting) {
      const auto i = static_cast<std::size_t>(joint);
      reached[i] += share * (qdd_[i] - reached[i]);
    }
    if (blocked >= 0) {
      mode_[static_cast<std::size_t>(blocked)] = 0;
      reached[static_cast<std::size_t>(blocked)] = 0.0;
    } else {
      double worst = -1.0;
      std::size_t next = 0;
      for (int joint : resting) {
        const auto i = static_cast<std::size_t>(joint);
        if (mode_[i] != 0 || excess_[i] == 0.0) continue;
        const double limit = level(i, excess_[i] > 0.0 ? 1 : -1, load_at_rest(i), t, q, z) * kReleaseMargin;
        // At the event itself the two are equal to the last digit, on the far side.
        const double over = limit > 0.0 ? std::abs(excess_[i]) / limit - 1.0 : 1e300;
        if (std::abs(excess_[i]) >= limit && over > worst) {
          worst = over;
          next = i;
        }
      }
      if (worst < 0.0) break;
      mode_[next] = excess_[next] > 0.0 ? 1 : -1;
    }
    relock();
  }
  return mode_ != before;
}

double Plant::effect_torque(int joint) const {
  const auto i = static_cast<std::size_t>(joint);
  return friction_[i] + (locked_[i] ? excess_[i] : 0.0);
}

void Plant::initial_extra(double t, const double* q, const double* qd, double* z) const {
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const Load& load = loads_[i];
    for (std::size_t k = 0; k < load.load.effects.size(); ++k) {
      const double sign = qd[i] > 0.0 ? 1.0 : qd[i] < 0.0 ? -1.0 : 0.0;
      load.load.effects[k]->initial_state({t, q[i], qd[i], sign}, z + load.state_offset[k]);
    }
  }
}

}  // namespace heft::sim
