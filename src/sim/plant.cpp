#include "plant.hpp"

#include <algorithm>
#include <cmath>

namespace heft::sim {
namespace {

/// A stuck joint starts when the load exceeds its level by this factor: more than rounding, so that it then
/// moves away from rest with certainty, and less than any level is known.
constexpr double kReleaseMargin = 1.0 + 1e-9;

}  // namespace

Plant::Plant(const SimulationSettings& settings)
    : n_(settings.robot.num_joints()),
      dynamics_(settings.robot),
      limit_(settings.torque_limit),
      held_(Eigen::VectorXd::Zero(n_)),
      motor_(Eigen::VectorXd::Zero(n_)),
      torque_function_(settings.controller == nullptr ? settings.torque : nullptr),
      wrench_(settings.tool_wrench) {
  if (settings.gravity) dynamics_.set_gravity(*settings.gravity);
  const auto n = static_cast<std::size_t>(n_);
  loads_.resize(n);
  is_dry_.assign(n, false);
  mode_.assign(n, 1);
  locked_ = std::make_unique<bool[]>(n);
  net_.assign(n, 0.0);
  qdd_.assign(n, 0.0);
  excess_.assign(n, 0.0);
  friction_.assign(n, 0.0);
  for (std::size_t i = 0; i < settings.loads.size(); ++i) {
    loads_[i].load = settings.loads[i];
    for (const auto& effect : loads_[i].load.effects) {
      loads_[i].state_offset.push_back(num_extra_);
      num_extra_ += effect->num_states();
    }
  }
  std::vector<double> z(static_cast<std::size_t>(num_extra_) + 1, 0.0);
  Eigen::VectorXd qd = settings.initial_velocity;
  if (qd.size() == 0) qd = Eigen::VectorXd::Zero(n_);
  initial_extra(0.0, settings.initial_position.data(), qd.data(), z.data());
  for (std::size_t i = 0; i < n; ++i) {
    if (loads_[i].load.sign != SignModel::kStickSlip || loads_[i].load.effects.empty()) continue;
    const double* q = settings.initial_position.data();
    is_dry_[i] = std::max(level(i, 1, 0.0, q, z.data()), level(i, -1, 0.0, q, z.data())) > 0.0;
    if (!is_dry_[i]) continue;
    dry_.push_back(static_cast<int>(i));
    const double velocity = qd[static_cast<Eigen::Index>(i)];
    mode_[i] = velocity > 0.0 ? 1 : velocity < 0.0 ? -1 : 0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    locked_[i] = is_dry_[i] && mode_[i] == 0;
    num_stuck_ += locked_[i] ? 1 : 0;
  }
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
  return {t, q[joint], qd[joint], direction};
}

double Plant::level(std::size_t joint, int direction, double t, const double* q, const double* z) const {
  const JointPoint rest{t, q[joint], 0.0, 0.0};
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
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const Load& load = loads_[i];
    double sum = 0.0;
    if (!load.load.effects.empty()) {
      const JointPoint at = point(i, t, q, qd);
      for (std::size_t k = 0; k < load.load.effects.size(); ++k) {
        sum += load.load.effects[k]->torque(at, z + load.state_offset[k]);
      }
    }
    friction_[i] = sum;
    net_[i] = torque[i] - sum;
  }
  Wrench wrench;
  if (wrench_) wrench = wrench_(t);
  dynamics_.acceleration(q, qd, net_.data(), num_stuck_ > 0 ? locked_.get() : nullptr,
                         wrench_ ? &wrench : nullptr, qdd_.data(), num_stuck_ > 0 ? excess_.data() : nullptr);
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
  for (std::size_t k = 0; k < dry_.size(); ++k) {
    const auto i = static_cast<std::size_t>(dry_[k]);
    if (locked_[i]) {
      const double load = excess_[i];
      g[k] = level(i, load >= 0.0 ? 1 : -1, t, q, z) * kReleaseMargin - std::abs(load);
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
  const auto relock = [&] {
    num_stuck_ = 0;
    for (int joint : dry_) {
      const auto i = static_cast<std::size_t>(joint);
      locked_[i] = mode_[i] == 0;
      num_stuck_ += locked_[i] ? 1 : 0;
    }
  };
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
        const double limit = level(i, excess_[i] > 0.0 ? 1 : -1, t, q, z) * kReleaseMargin;
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
