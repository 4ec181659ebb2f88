/// @file
/// What a model holds beyond rigid bodies and declared friction, along a reference.
#pragma once

#include <array>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/drive_torque.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/host/error.hpp"
#include "heft/model/robot.hpp"
#include "heft/model/run_time_arm.hpp"

namespace heft::track {

/// Scale of the smooth Coulomb sign in feed-forward and residual [rad/s, m/s].
inline constexpr double kSignWidth = 0.02;

/// What a model holds beyond rigid bodies and declared friction, along the reference: joint effects, gear couplings
/// and where the motors of elastic joints have to be for the links to follow.
template <int N>
class ModelFeedForward {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;

  /// @param friction  false leaves out declared friction, and with it what scales it
  ModelFeedForward(const model::Robot& nominal, bool friction)
      : nominal_(model::to_arm_model<N>(nominal)),
        actuation_(nominal_.model().actuation),
        elasticities_(nominal.elasticities) {
    if (!friction) {
      for (JointActuation<double>& actuation : actuation_) actuation = {actuation.rotor_inertia, 0, 0, 0};
    }
    if (drive_.configure(actuation_, kSignWidth) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: robot \"{}\": friction and rotors: expected finite values", nominal.name));
    }
    model::add_parts(nominal, drive_);
  }

  bool needed() const { return drive_.has_effects() || drive_.has_couplings() || !elasticities_.empty(); }

  /// Takes the next point of the reference.
  /// @param arm  with the load that is believed to be there
  Status update(double time, double sample_time, const Arm& arm, const JointReference<double, N>& reference) {
    const Vector load = inverse_dynamics(arm, reference.q, reference.qd, reference.qdd);
    deflection = rate = acceleration = Vector::Zero();
    if (!elasticities_.empty()) {
      // θ = x + τ/K. An estimated load comes in steps: the derivatives are those of the nominal arm.
      const Vector steady = inverse_dynamics(nominal_, reference.q, reference.qd, reference.qdd);
      const Vector change =
          points_ > 0 ? Vector((steady - last_load_) / sample_time) : Vector(Vector::Zero());
      const Vector change_of_change =
          points_ > 1 ? Vector((change - last_change_) / sample_time) : Vector(Vector::Zero());
      last_load_ = steady;
      last_change_ = change;
      ++points_;
      for (const Elasticity<double>& elasticity : elasticities_) {
        const int j = elasticity.joint;
        deflection[j] = load[j] / elasticity.stiffness;
        rate[j] = change[j] / elasticity.stiffness;
        acceleration[j] = change_of_change[j] / elasticity.stiffness;
      }
    }
    const Vector q = reference.q + deflection, qd = reference.qd + rate, qdd = reference.qdd + acceleration;
    torque = Vector::Zero();
    for (const Elasticity<double>& elasticity : elasticities_) {
      const int j = elasticity.joint;
      torque[j] += actuation_[static_cast<std::size_t>(j)].rotor_inertia * acceleration[j];
    }
    drive_.add_couplings(qd, qdd, torque);
    return drive_.add_effects(time, q, qd, load, torque);
  }

  // Of the last point.
  Vector torque = Vector::Zero();      ///< beyond rigid bodies, rotors and declared friction
  Vector deflection = Vector::Zero();  ///< motor before link [rad, m]
  Vector rate = Vector::Zero();        ///< its derivatives
  Vector acceleration = Vector::Zero();

 private:
  Arm nominal_;
  std::array<JointActuation<double>, static_cast<std::size_t>(N)> actuation_;
  std::vector<Elasticity<double>> elasticities_;
  DriveTorque<double, N, model::kMaxEffects, model::kMaxCouplings> drive_;
  Vector last_load_ = Vector::Zero(), last_change_ = Vector::Zero();
  int points_{0};
};

}  // namespace heft::track
