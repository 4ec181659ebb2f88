/// @file
/// Position, velocity and acceleration from sampled positions, causally, and torque with the same delay.
#pragma once

#include <type_traits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/filter/kept_decay.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Third-order low-pass (three equal real poles) whose states are the filtered signal and its first two
/// derivatives: x⃛ = ω³ (u − x) − 3 ω² ẋ − 3 ω ẍ. Every signal of a regression must pass the same filter, so
/// that torque and motion keep the same delay 3/ω; filter() serves both.
///
/// Steps are exact for an input that is linear between samples (a propagation by the matrix exponential, whose
/// triple pole has a closed form), so sample times may jitter.
template <typename Scalar, int N>
class StateVariableFilter {
 public:
  using Vector = JointVector<Scalar, N>;

  /// @param cut_off_hz  frequency of the poles ω / 2π, 1e-6 to 1e6; −3 dB lies at 0.51 of it
  /// @return kOutOfRange, state kept
  Status configure(Scalar cut_off_hz) noexcept {
    if (!(cut_off_hz >= static_cast<Scalar>(1e-6) && cut_off_hz <= static_cast<Scalar>(1e6))) {
      return Status::kOutOfRange;
    }
    omega_ = static_cast<Scalar>(6.283185307179586) * cut_off_hz;
    reset();
    return Status::kOk;
  }

  /// Forgets the past; the next sample is taken as having been constant before.
  void reset() noexcept { started_ = false; }

  /// Takes one sample.
  /// @param u       input, n
  /// @param period  time since the last sample taken, > 0 [s]; the filter restarts after a gap of ten time
  ///                constants. In less than 1e-4 of a time constant (1e-9 in double) an input cannot change: refused
  /// @return kNonFiniteInput (also for a number beyond kLargestInput) or kOutOfRange: state kept
  Status update(const Vector& u, Scalar period) noexcept {
    if (!all_usable(u)) {
      return Status::kNonFiniteInput;
    }
    if (!started_) {
      x_ = u;
      xd_.setZero();
      xdd_.setZero();
      previous_ = u;
      started_ = true;
      age_ = Scalar(0);
      return Status::kOk;
    }
    if (!(period > Scalar(0))) {
      return Status::kOutOfRange;
    }
    const Scalar h = omega_ * period;
    if (h > Scalar(10)) {
      started_ = false;
      return update(u, period);
    }
    if (h < static_cast<Scalar>(kShortestStep)) {
      return Status::kOutOfRange;
    }
    // Against the steady answer to the ramp u0 + s t, which is u0 + s (t − 3/ω) with velocity s, the rest decays as
    // e^{-ωt} (c0 + c1 t + c2 t²).
    const Scalar decay = decay_(h);
    const Scalar w = omega_;
    Vector x, xd, xdd;
    for (int i = 0; i < N; ++i) {
      const Scalar slope = (u[i] - previous_[i]) / period;
      const Scalar e = x_[i] - (previous_[i] - Scalar(3) * slope / w);
      const Scalar ed = xd_[i] - slope;
      const Scalar edd = xdd_[i];
      const Scalar c0 = e;
      const Scalar c1 = ed + w * e;
      const Scalar c2 = static_cast<Scalar>(0.5) * (edd + Scalar(2) * w * ed + w * w * e);
      const Scalar t = period;
      const Scalar p = c0 + t * (c1 + t * c2);
      const Scalar pd = c1 + Scalar(2) * t * c2;
      const Scalar pdd = Scalar(2) * c2;
      x[i] = u[i] - Scalar(3) * slope / w + decay * p;
      xd[i] = slope + decay * (pd - w * p);
      xdd[i] = decay * (pdd - Scalar(2) * w * pd + w * w * p);
      if (!is_finite(x[i]) || !is_finite(xd[i]) || !is_finite(xdd[i])) {
        return Status::kNonFiniteInput;
      }
    }
    x_ = x;
    xd_ = xd;
    xdd_ = xdd;
    previous_ = u;
    age_ = age_ + h < static_cast<Scalar>(100) ? age_ + h : static_cast<Scalar>(100);
    return Status::kOk;
  }

  /// True once the start-up transient has died away (ten time constants).
  bool settled() const noexcept { return started_ && age_ >= Scalar(10); }

  const Vector& value() const noexcept { return x_; }
  const Vector& derivative() const noexcept { return xd_; }
  const Vector& second_derivative() const noexcept { return xdd_; }
  /// Delay of a slow signal, 3/ω [s].
  Scalar delay() const noexcept { return Scalar(3) / omega_; }

 private:
  static constexpr double kShortestStep = std::is_same_v<Scalar, float> ? 1e-4 : 1e-9;

  Vector x_ = Vector::Zero(), xd_ = Vector::Zero(), xdd_ = Vector::Zero(), previous_ = Vector::Zero();
  Scalar omega_{static_cast<Scalar>(62.8)}, age_{0};
  KeptDecay<Scalar> decay_;
  bool started_{false};
};

}  // namespace heft
