/// @file
/// A controller that adapts to what the arm carries: Slotine and Li's passivity-based law for the ten parameters of a load.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/arm_model.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/detail/usable_model.hpp"
#include "heft/core/dynamics/reference_dynamics.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Adaptive control after J.-J. E. Slotine and W. Li, "On the adaptive control of robot manipulators", Int. J. Robotics Research
/// 6(3), 1987, of an arm that is known and a load that is not:
///
///     q̇_r = q̇_ref + Λ (q_ref − q),  s = q̇ − q̇_r
///     τ   = M̂ (q̈_r − κ s) + Ĉ q̇_r + ĝ − K s + feed-forward
///     dâ/dt = −Γ Yᵀ s
///
/// M̂, Ĉ, ĝ are of the arm with the load â on its last link, rotors in M̂; Y is what the joints feel of a unit of each of the load's
/// parameters, at q̈_r − κ s and q̇_r (ReferenceDynamics). With V = ½ sᵀ M s + ½ ãᵀ Γ⁻¹ ã and ã = â − a, a rigid arm and none of the
/// limits below, V̇ = −sᵀ (κ M + K) s: the tracking error vanishes, whether or not the motion determines the load. The estimate
/// itself need not become the true load, and it has no interval; LoadObserver is for knowing the load.
///
/// κ M s is the damping of computed torque: Λ = κ = ω gives the error of a known arm the double pole −ω of computed torque with
/// gains ω² and 2 ω.
///
/// What keeps the estimate from drifting:
/// - Dead zone. Noise and friction that is not modelled leave an s that says nothing about the load. With
///   σ² = Σ (s_i / dead_zone_i)², Γ is multiplied by 1 − 1/σ², and by zero where σ ≤ 1.
/// - Projection. After each step the estimate is a body that can exist: mass from zero to `largest_mass`, the rest as
///   make_physical() leaves it with `reach`. This is not the nearest body in the metric of Γ⁻¹, so V may rise at the boundary; the
///   estimate is bounded all the same.
/// - Anti-windup. While a torque is cut at its limit, s is the limit's doing and nothing is adapted.
/// - Rest. When the reference has stood for `longest_rest` nothing is adapted: static friction holds what is left of s, and
///   an estimate that followed it would move the arm at some time.
///
/// Switching over without a jump of the torque: set_load() with the load that the controller before believed in.
///
/// Cost: two inverse dynamics and two load regressors, with 6 joints about 3000 multiplications. No allocation, no exception, every
/// loop bounded.
template <typename Scalar, int N>
class AdaptiveController {
 public:
  using Dynamics = ReferenceDynamics<Scalar, N>;
  using Vector = JointVector<Scalar, N>;
  using Reference = JointReference<Scalar, N>;
  using Load = InertialParameters<Scalar>;

  struct Config {
    Vector position_rate = Vector::Constant(Scalar(20));  ///< Λ > 0 [1/s]
    Scalar damping_rate{20};                              ///< κ ≥ 0 [1/s]
    Vector damping = Vector::Zero();                      ///< K ≥ 0, besides κ M [N·m·s/rad, N·s/m]
    Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
    /// Γ of the mass, ≥ 0 [kg·s²/m²]; zero switches the adaptation off. A load that a joint of inertia M feels as y [N·m/kg]
    /// comes in without overshoot up to κ² M / (4 y²).
    Scalar mass_gain{2};
    /// Size of a load, > 0 [m]: Γ of the first moments is that of the mass times its square, of the inertia times its fourth power.
    Scalar size{static_cast<Scalar>(0.2)};
    Scalar largest_mass{50};                 ///< > 0 [kg]
    Scalar reach{static_cast<Scalar>(0.5)};  ///< of the centre of mass from the last link frame, > 0 [m]
    /// Of s, > 0 [rad/s, m/s]: what noise and unmodelled friction cause.
    Vector dead_zone = Vector::Constant(static_cast<Scalar>(0.005));
    /// A longer cycle adapts as this one would, > 0 [s]: across a dropout s is not known.
    Scalar longest_step{static_cast<Scalar>(0.02)};
    /// Of a reference that moves, all joints slower stand, ≥ 0 [rad/s, m/s].
    Scalar rest_speed{static_cast<Scalar>(0.001)};
    /// A reference that stands longer teaches nothing, > 0 [s].
    Scalar longest_rest{static_cast<Scalar>(0.5)};
  };

  /// What a cycle did.
  struct Record {
    Vector s = Vector::Zero();  ///< q̇ − q̇_r [rad/s, m/s]
    std::uint32_t limited{0};   ///< bit i: torque of joint i was cut at its limit
    bool adapted{false};        ///< the estimate took a step: outside the dead zone, no torque cut
    bool projected{false};      ///< the step would have left the loads that can exist
    bool at_rest{false};        ///< the reference has stood for longer than `longest_rest`
  };

  /// Starts without load.
  /// @param arm  what is known: links, rotor inertias, gravity; its friction belongs to `feed_forward`
  /// @return kOutOfRange: a setting; kNonFiniteInput: the arm. Anything but kOk keeps everything as it was.
  Status configure(const Config& config, const ArmModel<Scalar, N>& arm) noexcept {
    if (!in_range(config)) {
      return Status::kOutOfRange;
    }
    if (!detail::is_usable_model(arm)) {
      return Status::kNonFiniteInput;
    }
    typename JointFeedback<Scalar, N>::Config limits;
    limits.torque_limit = config.torque_limit;
    if (const Status status = limits_.configure(limits); status != Status::kOk) {
      return status;
    }
    config_ = config;
    dynamics_.set_model(arm);
    for (int i = 0; i < N; ++i) {
      rotor_[i] = arm.actuation[static_cast<std::size_t>(i)].rotor_inertia;
    }
    load_ = {};
    rest_ = Scalar(0);
    configured_ = true;
    return Status::kOk;
  }

  /// Sets what the arm is believed to carry; all zero for nothing.
  /// @param load  about the last link frame
  /// @return kNotPositiveDefinite: no body can have it; kOutOfRange: heavier than `largest_mass`; kNonFiniteInput. The load stays.
  Status set_load(const Load& load) noexcept {
    if (const Status status = check_physical(load); status != Status::kOk) {
      return status;
    }
    if (load[kMass] > config_.largest_mass) {
      return Status::kOutOfRange;
    }
    load_ = load;
    return Status::kOk;
  }

  /// Reflected inertias of the motors, n, where they are not those of the arm; not finite: the old ones stay [kg·m², kg].
  void set_rotors(const Vector& rotors) noexcept { rotor_ = all_usable(rotors) ? rotors : rotor_; }

  /// Replaces gravity, in the base frame [m/s²]; not finite: the old one stays.
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    if (all_usable(gravity)) {
      dynamics_.set_gravity(gravity);
    }
  }

  /// What the torque is computed with, about the last link frame: mass [kg], first moment [kg·m], inertia [kg·m²].
  const Load& load() const noexcept { return load_; }

  /// One cycle.
  /// @param q,qd          measured, n [rad, rad/s; m on a prismatic joint]
  /// @param feed_forward  torque beyond rigid links and rotors, friction along the reference for instance, n [N·m, N]
  /// @param dt            since the cycle before, > 0 [s]
  /// @param tau           torque, n [N·m, N]
  /// @param cut           not zero: the torque of the cycle before was not what acted; nothing is adapted
  /// @return kNotConfigured, kNonFiniteInput, kOutOfRange (dt): tau, record and load are as they were
  Status update(const Reference& reference, const Vector& q, const Vector& qd, const Vector& feed_forward,
                Scalar dt, Vector& tau, Record& record, std::uint32_t cut = 0) noexcept {
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (!all_usable(reference.q) || !all_usable(reference.qd) || !all_usable(reference.qdd) ||
        !all_usable(q) || !all_usable(qd) || !all_usable(feed_forward) || !is_usable(dt)) {
      return Status::kNonFiniteInput;
    }
    if (!(dt > Scalar(0))) {
      return Status::kOutOfRange;
    }
    const Vector rate = reference.qd - qd;
    const Vector& lambda = config_.position_rate;
    const Vector qd_r = reference.qd + lambda.cwiseProduct(reference.q - q);
    const Vector s = qd - qd_r;
    const Vector wanted_qdd = reference.qdd + lambda.cwiseProduct(rate) - config_.damping_rate * s;

    const auto trig = joint_trigonometry<typename Dynamics::Arm>(q);
    typename Dynamics::LoadRegressor Y;
    dynamics_.load_regressor(trig, q, qd, qd_r, wanted_qdd, Y);
    Vector wanted = dynamics_.torque(trig, q, qd, qd_r, wanted_qdd) + feed_forward;
    for (int i = 0; i < N; ++i) {
      for (int p = 0; p < kParametersPerLink; ++p) {
        wanted[i] += Y(i, p) * load_[static_cast<std::size_t>(p)];
      }
      wanted[i] += rotor_[i] * wanted_qdd[i] - config_.damping[i] * s[i];
    }
    ControlRecord control;
    if (const Status status = limits_.limit(wanted, tau, control); status != Status::kOk) {
      return status;
    }
    record = {};
    record.s = s;
    record.limited = control.limited;
    const bool stands = reference.qd.cwiseAbs().maxCoeff() <= config_.rest_speed;
    const Scalar rest = stands ? rest_ + dt : Scalar(0);
    record.at_rest = rest > config_.longest_rest;
    rest_ = record.at_rest ? config_.longest_rest : rest;
    if (control.limited == 0 && cut == 0 && !record.at_rest) {
      adapt(Y, s, dt < config_.longest_step ? dt : config_.longest_step, record);
    }
    return Status::kOk;
  }

 private:
  static bool in_range(const Config& c) noexcept {
    for (int i = 0; i < N; ++i) {
      const bool good = c.position_rate[i] > Scalar(0) && is_usable(c.position_rate[i]) &&
                        c.damping[i] >= Scalar(0) && is_usable(c.damping[i]) && c.dead_zone[i] > Scalar(0) &&
                        is_usable(c.dead_zone[i]);
      if (!good) {
        return false;
      }
    }
    return c.damping_rate >= Scalar(0) && is_usable(c.damping_rate) && c.mass_gain >= Scalar(0) &&
           is_usable(c.mass_gain) && c.size > Scalar(0) && is_usable(c.size) && c.largest_mass > Scalar(0) &&
           is_usable(c.largest_mass) && c.reach > Scalar(0) && is_usable(c.reach) &&
           c.longest_step > Scalar(0) && is_usable(c.longest_step) && c.rest_speed >= Scalar(0) &&
           is_usable(c.rest_speed) && c.longest_rest > Scalar(0) && is_usable(c.longest_rest);
  }

  /// â ← projection of â − Γ Yᵀ s dt.
  void adapt(const typename Dynamics::LoadRegressor& Y, const Vector& s, Scalar dt, Record& record) noexcept {
    Scalar outside{0};  // σ²
    for (int i = 0; i < N; ++i) {
      const Scalar ratio = s[i] / config_.dead_zone[i];
      outside += ratio * ratio;
    }
    if (!(outside > Scalar(1)) || !(config_.mass_gain > Scalar(0))) {
      return;
    }
    const Scalar gain = config_.mass_gain * (Scalar(1) - Scalar(1) / outside) * dt;
    const Scalar size2 = config_.size * config_.size;
    Load next = load_;
    for (int p = 0; p < kParametersPerLink; ++p) {
      const Scalar scale = p == kMass ? Scalar(1) : p <= kMcz ? size2 : size2 * size2;
      Scalar along{0};
      for (int i = 0; i < N; ++i) {
        along += Y(i, p) * s[i];
      }
      next[static_cast<std::size_t>(p)] -= gain * scale * along;
    }
    const Load wanted = next;
    if (next[kMass] > config_.largest_mass) {
      next[kMass] = config_.largest_mass;
    }
    // What is too large to be a body's parameter is not taken, the torque stands.
    if (make_physical(next, config_.reach) != Status::kOk) {
      return;
    }
    load_ = next;
    record.adapted = true;
    record.projected = next != wanted;
  }

  Config config_{};
  Dynamics dynamics_{};
  JointFeedback<Scalar, N> limits_;
  Vector rotor_ = Vector::Zero();
  Load load_{};     ///< â
  Scalar rest_{0};  ///< the reference has stood for so long [s]
  bool configured_{false};
};

}  // namespace heft
