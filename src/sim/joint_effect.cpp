#include "heft/sim/joint_effect.hpp"

#include <string>

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::sim {
namespace {

/// A joint effect of core; the direction is its sign, and its memory is a state.
template <typename Effect>
class CoreEffect : public JointEffect {
 public:
  CoreEffect(const EffectParameters<double>& parameters, const JointActuation<double>& actuation)
      : parameters_(parameters), actuation_(actuation) {}

  double torque(const JointPoint& point, const double* state) const override {
    return Effect::torque(parameters_, effect_point(point, state), actuation_);
  }
  double load_share() const override {
    if constexpr (std::is_same_v<Effect, LoadFriction>) return parameters_[0];
    return 0.0;
  }
  double load_gain() const override {
    if constexpr (std::is_same_v<Effect, TorqueScale>) return parameters_[0];
    return 0.0;
  }
  int num_states() const override { return EffectWithMemory<Effect> ? 1 : 0; }
  void initial_state(const JointPoint&, double* state) const override {
    if constexpr (EffectWithMemory<Effect>) state[0] = 0.0;
  }
  void rate(const JointPoint& point, const double* state, double* rate) const override {
    if constexpr (EffectWithMemory<Effect>) {
      rate[0] = Effect::memory_rate(parameters_, state[0], point.direction, point.velocity);
    }
  }

 private:
  static EffectPoint<double> effect_point(const JointPoint& point, const double* state) {
    EffectPoint<double> at;
    at.time = point.time;
    at.q = point.position;
    at.qd = point.velocity;
    at.direction = point.direction;
    at.load = point.load;
    at.temperature = point.temperature;
    if constexpr (EffectWithMemory<Effect>) at.memory = state[0];
    return at;
  }

  EffectParameters<double> parameters_;
  JointActuation<double> actuation_;
};

}  // namespace

double JointEffect::breakaway(const JointPoint& at_rest, int direction, const double* state) const {
  JointPoint rest = at_rest;
  rest.direction = 0.0;
  JointPoint slipping = at_rest;
  slipping.direction = direction;
  return direction * (torque(slipping, state) - torque(rest, state));
}

std::shared_ptr<const JointEffect> make_joint_effect(const heft::JointEffect<double>& effect,
                                                     const JointActuation<double>& actuation) {
  if (effect.kind == joint_effect_kind<RotorInertia>()) {
    throw ModelError(fmt::format(
        "simulation: joint {}: found the effect \"rotor_inertia\" among the loads, expected it in "
        "the robot; put it into the robot's effects or its actuation",
        effect.joint + 1));
  }
  std::shared_ptr<const JointEffect> made;
  visit_joint_effect(effect.kind, [&](auto type) {
    made = std::make_shared<CoreEffect<decltype(type)>>(effect.parameters, actuation);
  });
  if (made == nullptr) {
    throw ModelError(
        fmt::format("simulation: joint {}: found an effect of kind {}, expected one from 0 to {}; take the "
                    "kind from heft/core/effects/effects.hpp",
                    effect.joint + 1, effect.kind, kNumJointEffects - 1));
  }
  return made;
}

}  // namespace heft::sim
