/// @file
/// Friction, springs and other torques at a joint in addition to those of the rigid bodies, as small objects.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "heft/core/effects/effects.hpp"

namespace heft::sim {

/// Where a joint is, as an effect sees it.
struct JointPoint {
  double time;      ///< [s]
  double position;  ///< [rad, m]
  double velocity;  ///< [rad/s, m/s]
  /// Sign of the velocity: −1 or 1 while the joint slips, 0 while it sticks. With the smooth sign any
  /// value between. Effects take the sign from here, never from `velocity`.
  double direction;
  /// Torque that a joint at rest passes on to the rigid bodies [N·m, N], for the break-away level of
  /// effects with a load_share(); zero for a joint in motion.
  double load{0.0};
  double temperature{std::numeric_limits<double>::quiet_NaN()};  ///< of the joint [°C]; not a number: not simulated
};

/// A torque that the motor has to bring up on top of the rigid-body torque: motor torque = rigid body +
/// sum of effects. Friction is positive for positive motion.
///
/// An object is constant while a simulation runs; what changes lives in its states, which the integrator
/// carries. The torque must be smooth in time, position, velocity and states as long as the direction
/// stays; jumps belong in the direction.
class JointEffect {
 public:
  virtual ~JointEffect() = default;

  /// Torque at a point [N·m, N]. Called with direction 0 for a joint that sticks.
  /// @param state  num_states() values of this effect, null when it has none
  virtual double torque(const JointPoint& point, const double* state) const = 0;

  /// How much torque more than torque() at direction 0 it takes to set the joint in motion in `direction`
  /// (−1 or 1), counted along `direction` [N·m, N]. The default is the step of torque() from rest to slipping.
  /// A joint's level is the sum over its effects, and not below zero.
  virtual double breakaway(const JointPoint& at_rest, int direction, const double* state) const;

  /// μ of a friction μ |load| · direction, at least 0 and below 1; zero for an effect that does not see the
  /// load. The load depends on this friction in turn, so the simulator solves for it: torque() leaves it
  /// out in motion, where JointPoint::load is zero, and counts it at rest.
  virtual double load_share() const { return 0.0; }
  /// Share s of the torque passed on to the bodies that the motor brings up in addition, with that torque's own sign:
  /// s L; above -1.
  virtual double load_gain() const { return 0.0; }

  virtual int num_states() const { return 0; }
  /// Start values of the states.
  virtual void initial_state(const JointPoint&, double*) const {}
  /// Rates of the states.
  virtual void rate(const JointPoint&, const double*, double*) const {}
};

using JointEffects = std::vector<std::shared_ptr<const JointEffect>>;

/// Coulomb friction: Fc · direction, held at rest up to a break-away level that may be higher.
class CoulombFriction : public JointEffect {
 public:
  /// @param coulomb  sliding level Fc [N·m, N]
  /// @param stiction break-away level [N·m, N], at least Fc
  CoulombFriction(double coulomb, double stiction) : coulomb_(coulomb), stiction_(stiction) {}
  double torque(const JointPoint& point, const double*) const override { return coulomb_ * point.direction; }
  double breakaway(const JointPoint&, int, const double*) const override { return stiction_; }

 private:
  double coulomb_;
  double stiction_;
};

/// Viscous friction with an offset: Fv · q̇ + offset.
class ViscousFriction : public JointEffect {
 public:
  ViscousFriction(double viscous, double offset) : viscous_(viscous), offset_(offset) {}
  double torque(const JointPoint& point, const double*) const override {
    return viscous_ * point.velocity + offset_;
  }

 private:
  double viscous_;
  double offset_;
};

/// Coulomb levels that differ between the two directions: tau0 |direction|, so that the level is Fc + tau0
/// forward and Fc − tau0 backward. Unlike an offset it does not act on a joint at rest.
class AsymmetricFriction : public JointEffect {
 public:
  explicit AsymmetricFriction(double tau0) : tau0_(tau0) {}
  double torque(const JointPoint& point, const double*) const override {
    return tau0_ * (point.direction < 0.0 ? -point.direction : point.direction);
  }

 private:
  double tau0_;
};

/// One of heft's joint effects (core/effects) as it acts in a simulation. What the effect remembers is a
/// state.
/// @param actuation  the joint's declared friction, which some effects scale or replace
/// @throws ModelError for an effect that does not exist and for `rotor_inertia`, which belongs to the
///         robot: the simulator takes it from there.
std::shared_ptr<const JointEffect> make_joint_effect(const heft::JointEffect<double>& effect,
                                                     const JointActuation<double>& actuation);

/// How the sign of the velocity is taken near standstill.
enum class SignModel {
  /// The joint slips forward, slips backward or sticks; changes are found as events and a stuck joint does
  /// not move at all.
  kStickSlip,
  /// tanh(q̇/ε): cheap to look at, but a loaded joint creeps, and the equations turn stiff.
  kSmooth
};

/// A joint that warms up, or cools down: end + (start - end) e^(-t / time constant).
struct Warming {
  double start{20.0};          ///< [°C]
  double end{20.0};            ///< [°C]
  double time_constant{600.0};  ///< [s]

  double at(double t) const { return end + (start - end) * std::exp(-t / time_constant); }
};

/// Everything that acts at one joint.
struct JointLoad {
  JointEffects effects;
  SignModel sign{SignModel::kStickSlip};
  double smooth_speed{1e-3};  ///< ε of the smooth sign [rad/s, m/s]
  std::optional<Warming> temperature{};  ///< of the joint; none: no temperature in the log either
};

}  // namespace heft::sim
