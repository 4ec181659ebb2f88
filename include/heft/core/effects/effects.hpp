/// @file
/// The joint effects that heft knows, and their torque at run time.
#pragma once

#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

#include "heft/core/effects/displacement.hpp"
#include "heft/core/effects/friction_curve.hpp"
#include "heft/core/effects/friction_drift.hpp"
#include "heft/core/effects/friction_temperature.hpp"
#include "heft/core/effects/hysteresis.hpp"
#include "heft/core/effects/load_friction.hpp"
#include "heft/core/effects/offset.hpp"
#include "heft/core/effects/ripple.hpp"
#include "heft/core/effects/rotor_inertia.hpp"
#include "heft/core/effects/spring.hpp"
#include "heft/core/effects/stribeck.hpp"
#include "heft/core/effects/torque_scale.hpp"
#include "heft/core/effects/viscous_nonlinear.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft {

/// Every joint effect, simplest first: where a motion cannot distinguish two effects, the earlier one is
/// named. A new effect is one file and one entry here; search, simulator, model files and export read this list.
using JointEffectTypes = std::tuple<Offset, RotorInertia, ViscousNonlinear, Stribeck, LoadFriction,
                                    TorqueScale, Spring, Hysteresis, FrictionTemperature, FrictionDrift, Ripple,
                                    FrictionCurve>;

inline constexpr int kNumJointEffects = static_cast<int>(std::tuple_size_v<JointEffectTypes>);

/// An effect's place in JointEffectTypes.
template <typename Effect, int I = 0>
constexpr int joint_effect_kind() {
  static_assert(I < kNumJointEffects, "the effect is not in JointEffectTypes");
  if constexpr (std::is_same_v<Effect, std::tuple_element_t<static_cast<std::size_t>(I), JointEffectTypes>>) {
    return I;
  } else {
    return joint_effect_kind<Effect, I + 1>();
  }
}

/// Calls f(Effect{}) for the effect of that kind; does nothing for a kind that does not exist.
template <typename F>
constexpr void visit_joint_effect(int kind, F&& f) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    static_cast<void>(
        ((static_cast<int>(I) == kind ? (f(std::tuple_element_t<I, JointEffectTypes>{}), true) : false) ||
         ...));
  }
  (std::make_index_sequence<std::tuple_size_v<JointEffectTypes>>{});
}

/// Kind with that id; -1 when there is none.
constexpr int joint_effect_kind(std::string_view id) {
  int found = -1;
  for (int kind = 0; kind < kNumJointEffects; ++kind) {
    visit_joint_effect(kind, [&](auto effect) {
      if (decltype(effect)::kId == id) found = kind;
    });
  }
  return found;
}

template <typename Effect>
concept EffectWithMemory = requires(EffectParameters<double> p) {
  Effect::memory(p, 0.0, 0.0);
};

/// Whether the effect of that kind carries a state along the motion; false for a kind that does not exist.
constexpr bool joint_effect_has_memory(int kind) {
  bool has = false;
  visit_joint_effect(kind, [&](auto effect) { has = EffectWithMemory<decltype(effect)>; });
  return has;
}

/// One effect on one joint with its values.
template <typename Scalar>
struct JointEffect {
  int kind{0};                                         ///< place in JointEffectTypes
  int joint{0};                                        ///< counted from 0
  EffectParameters<Scalar> parameters{};               ///< in the order of the effect's kParameters
  Displacement displacement{Displacement::kPosition};  ///< that its memory goes by
  SeenWithin<Scalar> seen{};                           ///< the motion that it was seen in
};

/// Whether each interval has its ends in order; one that is not a number has not.
template <typename Scalar>
constexpr bool is_in_order(const SeenWithin<Scalar>& seen) {
  const auto in_order = [](const SeenInterval<Scalar>& interval) { return interval.low <= interval.high; };
  return in_order(seen.velocity) && in_order(seen.load) && in_order(seen.position) && in_order(seen.temperature);
}

/// First of the effect's parameters, in the order of kParameters, that lies outside its range (a length or time that is
/// not positive, a part outside 0 to 1, a number that is not finite); -1 when all are within, or for a kind that does
/// not exist.
template <typename Scalar>
constexpr int parameter_out_of_range(const JointEffect<Scalar>& effect) {
  int found = -1;
  visit_joint_effect(effect.kind, [&](auto type) {
    const auto& given = decltype(type)::kParameters;
    for (std::size_t i = 0; i < given.size() && found < 0; ++i) {
      const Scalar& value = effect.parameters[i];
      const bool within =
          is_finite(value) && (given[i].range != EffectRange::kPositive || value > Scalar(0)) &&
          (given[i].range != EffectRange::kPart || (value >= Scalar(0) && value <= Scalar(1)));
      found = within ? -1 : static_cast<int>(i);
    }
  });
  return found;
}

/// Torque of an effect at one instant [N·m, N]; 0 for a kind that does not exist. Beyond the motion that it was seen in
/// the effect keeps its torque, or fades: SeenWithin. No allocation.
/// @param actuation  the joint's declared friction: some effects scale or replace it
template <typename Scalar>
Scalar joint_effect_torque(const JointEffect<Scalar>& effect, const EffectPoint<Scalar>& point,
                           const JointActuation<Scalar>& actuation) {
  Scalar torque(0);
  EffectPoint<Scalar> held = point;
  visit_joint_effect(effect.kind, [&](auto type) {
    using Effect = decltype(type);
    hold_within<Effect>(effect.seen, held);
    torque = Effect::torque(effect.parameters, held, actuation);
    if constexpr (requires { Effect::kFadesBeyond; })
      torque *= part_left<Effect>(effect.seen, point);
  });
  return torque;
}

/// State of an effect after `travel`; unchanged for an effect that has none.
template <typename Scalar>
Scalar joint_effect_memory(const JointEffect<Scalar>& effect, Scalar memory, Scalar travel) {
  Scalar after = memory;
  visit_joint_effect(effect.kind, [&](auto type) {
    using Effect = decltype(type);
    if constexpr (EffectWithMemory<Effect>) after = Effect::memory(effect.parameters, memory, travel);
  });
  return after;
}

/// State of an effect on a joint at rest that friction holds with `held` [N·m, N]; 0 for an effect that has none.
template <typename Scalar>
Scalar joint_effect_memory_at_rest(const JointEffect<Scalar>& effect, Scalar held,
                                   const JointActuation<Scalar>& actuation) {
  Scalar memory(0);
  visit_joint_effect(effect.kind, [&](auto type) {
    using Effect = decltype(type);
    if constexpr (EffectWithMemory<Effect>) {
      memory = Effect::memory_at_rest(effect.parameters, held, actuation);
    }
  });
  return memory;
}

}  // namespace heft
