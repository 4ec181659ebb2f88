/// @file
/// The effects that reach more than one joint, and the type that names any effect.
///
/// A joint effect (effects.hpp) is a torque of its own joint. What changes the motion, gravity, the last link, or the
/// torque of several joints is an arm effect: one struct in a file of its own under arm/ and one entry here. It states
///
///   kId, kEquation, kParameters, kShownBy    as a joint effect does (effect_point.hpp)
///
/// How it acts is too different from one to the next for a common form. Each room that has to know it holds an
/// overload for each type and visits this list, so that the compiler names what a new entry still lacks: search
/// (src/diagnose/arm_search.hpp), words (src/report/effect_words.hpp), model files (src/model/model_file.cpp) and
/// scenarios (src/sim/scenario_effects.cpp).
#pragma once

#include <array>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

#include "heft/core/effects/arm/base_tilt.hpp"
#include "heft/core/effects/arm/cable.hpp"
#include "heft/core/effects/arm/contact.hpp"
#include "heft/core/effects/arm/delay.hpp"
#include "heft/core/effects/arm/elastic_joint.hpp"
#include "heft/core/effects/arm/payload_change.hpp"
#include "heft/core/effects/arm/wrist_coupling.hpp"
#include "heft/core/effects/effects.hpp"

namespace heft {

/// Every arm effect, in the order in which a diagnosis tries them.
using ArmEffectTypes = std::tuple<ElasticJoint, Delay, BaseTilt, PayloadChange, WristCoupling, Cable, Contact>;

namespace detail {

template <typename Effect, typename List>
inline constexpr bool kListed = false;
template <typename Effect, typename... Listed>
inline constexpr bool kListed<Effect, std::tuple<Listed...>> = (std::is_same_v<Effect, Listed> || ...);

template <typename First, typename Second>
struct Joined;
template <typename... A, typename... B>
struct Joined<std::tuple<A...>, std::tuple<B...>> {
  using Type = std::tuple<A..., B...>;
};

}  // namespace detail

/// Joint effects first, in their order, then arm effects.
using EffectTypes = detail::Joined<JointEffectTypes, ArmEffectTypes>::Type;

template <typename Effect>
concept ListedEffect = detail::kListed<Effect, EffectTypes>;
template <typename Effect>
concept ArmEffect = detail::kListed<Effect, ArmEffectTypes>;

/// One of EffectTypes.
class EffectKind {
 public:
  template <ListedEffect Effect>
  constexpr EffectKind(Effect) noexcept : place_(place_of<Effect>()) {}
  template <ListedEffect Effect>
  constexpr bool is() const noexcept {
    return place_ == place_of<Effect>();
  }
  /// Place in JointEffectTypes; -1 for an arm effect.
  constexpr int joint_effect() const noexcept {
    return place_ < static_cast<std::size_t>(kNumJointEffects) ? static_cast<int>(place_) : -1;
  }
  /// f(Effect{}), which has to give the same type for every effect.
  template <typename F>
  constexpr auto visit(F&& f) const {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      using Result = decltype(f(std::tuple_element_t<0, EffectTypes>{}));
      constexpr std::array<Result (*)(F&), kCount> calls{
          [](F& g) -> Result { return g(std::tuple_element_t<I, EffectTypes>{}); }...};
      return calls[place_](f);
    }
    (std::make_index_sequence<kCount>{});
  }

  constexpr std::string_view id() const noexcept {
    return visit([](auto effect) { return decltype(effect)::kId; });
  }
  constexpr std::string_view equation() const noexcept {
    return visit([](auto effect) { return decltype(effect)::kEquation; });
  }
  constexpr std::string_view shown_by() const noexcept {
    return visit([](auto effect) { return decltype(effect)::kShownBy; });
  }
  /// The parameter of that name; none: nullptr.
  constexpr const EffectParameter* parameter(std::string_view name) const noexcept {
    return visit([name](auto effect) {
      const EffectParameter* found = nullptr;
      for (const EffectParameter& p : decltype(effect)::kParameters) {
        if (p.name == name) found = &p;
      }
      return found;
    });
  }

  friend constexpr bool operator==(EffectKind, EffectKind) noexcept = default;

 private:
  static constexpr std::size_t kCount = std::tuple_size_v<EffectTypes>;

  constexpr explicit EffectKind(std::size_t place) noexcept : place_(place) {}
  template <typename Effect, std::size_t I = 0>
  static constexpr std::size_t place_of() noexcept {
    if constexpr (std::is_same_v<Effect, std::tuple_element_t<I, EffectTypes>>) {
      return I;
    } else {
      return place_of<Effect, I + 1>();
    }
  }

  std::size_t place_;
};

/// Every effect.
inline constexpr auto kEffectKinds = []<std::size_t... I>(std::index_sequence<I...>) {
  return std::array{EffectKind(std::tuple_element_t<I, EffectTypes>{})...};
}
(std::make_index_sequence<std::tuple_size_v<EffectTypes>>{});

/// The effect with that id; none: nullptr.
constexpr const EffectKind* effect_with_id(std::string_view id) noexcept {
  for (const EffectKind& kind : kEffectKinds) {
    if (kind.id() == id) return &kind;
  }
  return nullptr;
}

/// Calls f(Effect{}) for every arm effect.
template <typename F>
constexpr void for_each_arm_effect(F&& f) {
  [&]<std::size_t... I>(std::index_sequence<I...>) { (f(std::tuple_element_t<I, ArmEffectTypes>{}), ...); }
  (std::make_index_sequence<std::tuple_size_v<ArmEffectTypes>>{});
}

}  // namespace heft
