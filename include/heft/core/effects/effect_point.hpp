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
/// and may state `memory(p, z, travel)`, `memory_rate(p, z, direction, velocity)`, `memory_at_rest(p, held, joint)`
/// (a state that the motion carries, starting at 0 or from the torque seen to hold a joint at rest) and
/// `kReplacesCoulomb` (its column, added to the Coulomb column, may take that one's place wholly).
#pragma once

#include <array>
#include <cstdint>
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

/// Unit of a shape's range.
enum class ShapeScale : std::uint8_t {
  kAbsolute,  ///< as given
  kTopSpeed,  ///< the joint's largest speed
  kTravel,    ///< the joint's largest minus smallest position
  kDuration   ///< length of the log
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
