/// @file
/// The parts of every joint effect: its inputs, the names of its parameters and their ranges.
///
/// A joint effect is a torque of the motor in addition to rigid body, Coulomb and viscous friction:
/// motor torque = declared model + sum of effects, sign along positive q. Each effect is one struct in a file
/// of its own in this folder, and one entry in effects.hpp. The struct states
///
///   kId, kEquation            id in files and JSON (tools/README.md), and the term as text
///   kParameters               names, units and ranges of its physical parameters
///   kShapes                   ranges of the parameters that the torque is not linear in (at most one)
///   kNotNegative              which of its linear coefficients cannot be negative
///   kShownBy                  the motion that shows it
///   columns(shape, point)     the terms that its linear coefficients multiply
///   parameters(c, shape, joint)  physical parameters of fitted coefficients
///   torque(p, point, joint)   the effect's torque; equals columns times coefficients
///
/// and may state what it goes by beyond the motion that it was seen in (see SeenWithin): `kHeldBeyond`, a quantity at
/// whose border it keeps its torque, or `kFadesBeyond`, one behind whose border it goes to zero;
/// `memory(p, z, travel)`, `memory_rate(p, z, direction, velocity)`, `memory_at_rest(p, held, joint)`
/// (a state that the motion carries, starting at 0 or from the torque seen to hold a joint at rest) and
/// `kReplacesCoulomb` (its column, added to the Coulomb column, may take that one's place wholly).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include "heft/core/arm_model.hpp"

namespace heft {

/// One joint at one instant, as an effect sees it.
template <typename Scalar>
struct EffectPoint {
  Scalar time{0};       ///< since the log, or the run, began [s]
  Scalar q{0};          ///< [rad, m]
  Scalar qd{0};         ///< [rad/s, m/s]
  Scalar qdd{0};        ///< [rad/s², m/s²]
  Scalar direction{0};  ///< sign of the velocity, sharp or smooth, within [-1, 1]
  Scalar load{0};       ///< torque of the rigid bodies that the joint transmits [N·m, N]
  Scalar memory{0};     ///< the effect's own state
  /// Of the joint [°C]; not a number where nobody measures it: an effect that goes by it adds nothing then.
  Scalar temperature{std::numeric_limits<Scalar>::quiet_NaN()};
};

/// Where a physical parameter may lie.
enum class EffectRange : std::uint8_t {
  kAny,       ///< any finite number
  kPositive,  ///< above zero: a width, a length, a time, an exponent, a number of periods
  kPart       ///< a part, 0 to 1, that may be left out of a file: 0 then
};

/// Name and unit of a physical parameter.
struct EffectParameter {
  std::string_view name;
  std::string_view unit;            ///< on a revolute joint
  std::string_view prismatic_unit;  ///< on a prismatic joint
  EffectRange range{EffectRange::kAny};
};

/// Largest number of physical parameters of a joint effect.
inline constexpr int kMaxEffectParameters = 4;

/// Values of an effect's physical parameters in the order of kParameters; the rest is not used.
template <typename Scalar>
using EffectParameters = std::array<Scalar, kMaxEffectParameters>;

/// A quantity that the torque of an effect goes with.
enum class SeenBy : std::uint8_t { kVelocity, kLoad, kPosition, kTemperature };

/// Smallest and largest value of a quantity; without limits unless set.
template <typename Scalar>
struct SeenInterval {
  Scalar low{std::numeric_limits<Scalar>::lowest()};
  Scalar high{std::numeric_limits<Scalar>::max()};
};

/// Whether both ends are set.
template <typename Scalar>
constexpr bool is_limited(const SeenInterval<Scalar>& interval) {
  const SeenInterval<Scalar> anywhere;
  return interval.low > anywhere.low && interval.high < anywhere.high;
}

/// The motion that an effect was seen in. What no log has shown is no part of it: beyond, its torque stays what it was at
/// the border (friction, load, temperature, springs), or goes to zero within a way as long as the one that was seen (ripple: the number
/// of its periods is known so well that its phase is right along that way, and no better), so that the rest of the model
/// says what changes. Friction and load count by their size: what was seen in one direction holds in the other, as in the
/// declared friction. Without limits unless set.
template <typename Scalar>
struct SeenWithin {
  SeenInterval<Scalar> velocity{};  ///< of the joint [rad/s, m/s]
  SeenInterval<Scalar> load{};      ///< torque of the rigid bodies that the joint transmits [N·m, N]
  SeenInterval<Scalar> position{};  ///< [rad, m]
  SeenInterval<Scalar> temperature{};  ///< of the joint [°C]
};

namespace detail {

/// The nearest value of an interval; NaN stays.
template <typename Scalar>
constexpr Scalar nearest(const Scalar& value, const Scalar& low, const Scalar& high) {
  return value > high ? high : value < low ? low : value;
}

/// A value no larger than the largest size seen.
template <typename Scalar>
constexpr Scalar held(const Scalar& value, const SeenInterval<Scalar>& seen) {
  const Scalar most = seen.high > -seen.low ? seen.high : -seen.low;
  return nearest(value, -most, most);
}

}  // namespace detail

/// Makes of an instant what an effect sees of it that keeps its torque beyond what was seen. In place: a copy for each
/// kind of effect would be a kilobyte of a controller's stack.
template <typename Effect, typename Scalar>
constexpr void hold_within(const SeenWithin<Scalar>& seen, EffectPoint<Scalar>& point) {
  if constexpr (requires { Effect::kHeldBeyond; }) {
    if constexpr (Effect::kHeldBeyond == SeenBy::kVelocity) point.qd = detail::held(point.qd, seen.velocity);
    if constexpr (Effect::kHeldBeyond == SeenBy::kLoad) point.load = detail::held(point.load, seen.load);
    if constexpr (Effect::kHeldBeyond == SeenBy::kPosition)
      point.q = detail::nearest(point.q, seen.position.low, seen.position.high);
    if constexpr (Effect::kHeldBeyond == SeenBy::kTemperature)
      point.temperature =
          detail::nearest(point.temperature, seen.temperature.low, seen.temperature.high);
  }
}

/// Part of an effect's torque that is left beyond what was seen, 0 to 1; 1 for one that does not fade.
template <typename Effect, typename Scalar>
constexpr Scalar part_left(const SeenWithin<Scalar>& seen, const EffectPoint<Scalar>& point) {
  if constexpr (requires { Effect::kFadesBeyond; }) {
    static_assert(Effect::kFadesBeyond == SeenBy::kPosition, "nothing fades by another quantity yet");
    const Scalar border = detail::nearest(point.q, seen.position.low, seen.position.high);
    const Scalar beyond = point.q > border ? point.q - border : border - point.q;
    if (!(beyond > Scalar(0))) return Scalar(1);
    const Scalar way = seen.position.high - seen.position.low;
    return beyond < way ? Scalar(1) - beyond / way : Scalar(0);
  } else {
    return Scalar(1);
  }
}

/// Unit of a shape's range.
enum class ShapeScale : std::uint8_t {
  kAbsolute,  ///< as given
  kTopSpeed,  ///< the joint's largest speed
  kTravel,    ///< the joint's largest minus smallest position
  kDuration,  ///< length of the log
  kTemperature  ///< the joint's mean temperature in the logs: a point to count from, not searched for
};

/// Where a search looks for a parameter that the torque is not linear in.
struct ShapeRange {
  double from;
  double to;
  ShapeScale scale;
  int steps;   ///< of the first grid, evenly spaced in the logarithm
  bool whole;  ///< whole numbers only: every one from `from` to `to`
  bool fixed;  ///< `from` and `to` are the only two values
};

}  // namespace heft
