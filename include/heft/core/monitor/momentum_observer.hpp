/// @file
/// Torque from outside, from the balance of generalised momentum.
#pragma once

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/lagrangian.hpp"
#include "heft/core/filter/kept_decay.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Momentum observer after De Luca and Mattone (2003, 2005): with momentum p = (M + B) q̇,
///
///   ṗ = τ − friction + ∂L/∂q + τ_ext,   r = K (p − ∫ (τ − friction + ∂L/∂q + r) dt),
///
/// so that ṙ = K (τ_ext − r): the residual r is the torque from outside behind a first-order low-pass, and needs no
/// acceleration. It also holds whatever the model of the arm misses.
///
/// Taken from sample to sample the integral need not be kept: over a period h the mean torque from outside is
/// d = Δp / h − mean(τ − friction + ∂L/∂q), and r ← e^{−Kh} r + (1 − e^{−Kh}) d. Nothing accumulates, so that float does
/// after a year what it does after a second, and periods may jitter.
///
/// @tparam N  number of joints
template <typename Scalar, int N>
class MomentumObserver {
 public:
  using Vector = JointVector<Scalar, N>;
  using Matrix = Eigen::Matrix<Scalar, N, N>;

  struct Config {
    Scalar bandwidth{25};  ///< K [1/s]: a step of the torque shows to 63 % after 1/K; 1e-3 to 1e5
    /// B, constant: rotor inertia on the diagonal, what gear couplings share off it [kg·m², kg].
    Matrix motor_inertia = Matrix::Zero();
    /// A longer period restarts the observer: in between the torque is not known [s]. 1e-4 to 1e3.
    Scalar longest_period{static_cast<Scalar>(0.1)};
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    if (!(config.bandwidth >= static_cast<Scalar>(1e-3) && config.bandwidth <= static_cast<Scalar>(1e5)) ||
        !(config.longest_period >= static_cast<Scalar>(1e-4) && config.longest_period <= Scalar(1000))) {
      return Status::kOutOfRange;
    }
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        if (!is_usable(config.motor_inertia(i, j))) return Status::kOutOfRange;
      }
    }
    config_ = config;
    configured_ = true;
    reset();
    return Status::kOk;
  }

  /// Forgets the past; the next sample but one gives the first residual, which is not filtered yet.
  void reset() noexcept {
    samples_ = 0;
    residual_.setZero();
    torque_.setZero();
  }

  /// Takes one sample.
  /// @param terms     lagrangian_terms() of the model at this q, q̇
  /// @param qd        velocities, n [rad/s, m/s]
  /// @param tau       torque measured at the motors, n [N·m, N]
  /// @param friction  what of it the model gives to friction, gears and joint effects, n [N·m, N]
  /// @param period    time since the last sample that was taken [s]
  /// @return kNonFiniteInput, kNotConfigured, kOutOfRange (a period that is not positive: time stood or went
  ///         backwards); state kept
  Status update(const LagrangianTerms<Scalar, N>& terms, const Vector& qd, const Vector& tau,
                const Vector& friction, Scalar period) noexcept {
    if (!configured_) return Status::kNotConfigured;
    if (!all_usable(terms.momentum) || !all_usable(terms.gradient) || !all_usable(qd) || !all_usable(tau) ||
        !all_usable(friction)) {
      return Status::kNonFiniteInput;
    }
    if (const Status time = look_at(period, samples_ > 0); time != Status::kOk) return time;
    Vector momentum, drive;
    for (int i = 0; i < N; ++i) {
      Scalar p = terms.momentum[i];
      for (int j = 0; j < N; ++j) p += config_.motor_inertia(i, j) * qd[j];
      momentum[i] = p;
      drive[i] = tau[i] - friction[i] + terms.gradient[i];
    }
    if (samples_ > 0) {
      const Scalar half = static_cast<Scalar>(0.5);
      const Vector outside = (momentum - momentum_) / period - half * (drive + drive_);
      if (!pass(outside, half * (tau + tau_), period)) return Status::kNonFiniteInput;
    } else {
      torque_ = tau;
    }
    momentum_ = momentum;
    drive_ = drive;
    tau_ = tau;
    samples_ += samples_ < 2 ? 1 : 0;
    return Status::kOk;
  }

  /// Takes the time between two samples, from the torque that the model explains in it. With the mass matrix of the motion
  /// half-way, Δp = M Δq̇ + ΔM q̇, and d becomes the torque of the model there at the acceleration Δq̇ / h, friction and
  /// rotors included, less the measured one: the same but for terms of h², and nothing need be kept. Use this form or the
  /// other, and reset() in between.
  /// @param explained  torque of the model half-way, n [N·m, N]
  /// @param tau        torque measured at the motors, mean over the period, n [N·m, N]
  /// @param period     > 0; a long one restarts the observer, and its torques are not taken [s]
  /// @return as above
  Status update(const Vector& explained, const Vector& tau, Scalar period) noexcept {
    if (!configured_) return Status::kNotConfigured;
    if (!all_usable(explained) || !all_usable(tau)) return Status::kNonFiniteInput;
    if (const Status time = look_at(period, true); time != Status::kOk) return time;
    if (period > config_.longest_period) return Status::kOk;
    if (!pass(explained - tau, tau, period)) return Status::kNonFiniteInput;
    samples_ = 2;
    return Status::kOk;
  }

  /// r: torque from outside on the arm, along positive q, behind the low-pass, n [N·m, N].
  const Vector& residual() const noexcept { return residual_; }
  /// Torque that the model explains, behind the same low-pass, n [N·m, N].
  Vector explained() const noexcept { return torque_ + residual_; }
  /// Whether two samples in a row have come since the start or the last gap.
  bool running() const noexcept { return samples_ >= 2; }
  const Config& config() const noexcept { return config_; }

 private:
  /// Whether time may go on; a long period restarts the observer.
  Status look_at(const Scalar& period, bool started) noexcept {
    // However long: a gap is no fault of the sample after it.
    const Status time = check_step(period, started, static_cast<Scalar>(kLargestInput<Scalar>));
    if (time == Status::kOk && period > config_.longest_period) samples_ = 0;
    return time;
  }

  /// Mean torques over a period through the low-pass.
  bool pass(const Vector& outside, const Vector& tau, const Scalar& period) noexcept {
    const Scalar keep = samples_ > 1 ? decay_(config_.bandwidth * period) : Scalar(0);
    Vector residual, torque;
    for (int i = 0; i < N; ++i) {
      residual[i] = keep * residual_[i] + (Scalar(1) - keep) * outside[i];
      torque[i] = keep * torque_[i] + (Scalar(1) - keep) * tau[i];
      if (!is_usable(residual[i]) || !is_usable(torque[i])) return false;
    }
    residual_ = residual;
    torque_ = torque;
    return true;
  }

  Config config_{};
  KeptDecay<Scalar> decay_;
  Vector residual_ = Vector::Zero(), torque_ = Vector::Zero();
  Vector momentum_ = Vector::Zero(), drive_ = Vector::Zero(), tau_ = Vector::Zero();  ///< of the last sample
  int samples_{0};                                                                    ///< in a row, up to 2
  bool configured_{false};
};

}  // namespace heft
