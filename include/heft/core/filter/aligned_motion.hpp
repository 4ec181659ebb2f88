/// @file
/// Motion, reference and torque of a running arm as a regression needs them: all with the same delay.
#pragma once

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Encoder positions, reference, sign of the velocity and torque through the same filter, so that velocity and acceleration come
/// out without differencing and everything keeps the delay 3/ω. The sign passes the filter as a sign: a filtered sign is
/// not the sign of a filtered velocity.
///
/// A torque that is reported with a sample acted since the sample before, so motion is taken half-way between the two.
template <typename Scalar, int N>
class AlignedMotion {
 public:
  using Vector = JointVector<Scalar, N>;

  /// @param cut_off_hz  poles of the filter, see StateVariableFilter
  /// @param sign_width  of the sign, see velocity_sign, ≥ 0 [rad/s, m/s]
  /// @return kOutOfRange: state kept
  Status configure(Scalar cut_off_hz, Scalar sign_width) noexcept {
    Filter filter;
    if (!(sign_width >= Scalar(0)) || !is_usable(sign_width) || filter.configure(cut_off_hz) != Status::kOk) {
      return Status::kOutOfRange;
    }
    motion_ = reference_ = sign_ = torque_ = filter;
    sign_width_ = sign_width;
    started_ = false;
    return Status::kOk;
  }

  /// Forgets the past.
  void reset() noexcept {
    motion_.reset();
    reference_.reset();
    sign_.reset();
    torque_.reset();
    started_ = false;
  }

  /// Takes one sample. The first gives the end of the motion before it alone: its torque and its dt are not used.
  ///
  /// @param q,qd   positions, and velocities of any source, n [rad, rad/s; m on a prismatic joint]
  /// @param q_ref  where the arm was to be, n
  /// @param tau    torque since the sample before, n [N·m, N]
  /// @param dt     since the sample before, > 0 [s]
  /// @param known  status = known(middle q, middle qd, tau): takes off what the regression does not look for
  /// @return kNonFiniteInput, kOutOfRange (dt), or what `known` returns: the sample leaves no trace
  template <typename Known>
  Status update(const Vector& q, const Vector& qd, const Vector& q_ref, const Vector& tau, Scalar dt,
                Known&& known) noexcept {
    if (!all_usable(q) || !all_usable(qd) || !all_usable(q_ref) || !all_usable(tau)) {
      return Status::kNonFiniteInput;
    }
    if (started_ && !(dt > Scalar(0))) {
      return Status::kOutOfRange;
    }
    const Vector middle = static_cast<Scalar>(0.5) * (q + last_q_);
    const Vector velocity = static_cast<Scalar>(0.5) * (qd + last_qd_);
    const Vector wanted = static_cast<Scalar>(0.5) * (q_ref + last_q_ref_);
    if (started_) {
      Vector sign, left = tau;
      for (int i = 0; i < N; ++i) {
        sign[i] = velocity_sign(velocity[i], sign_width_);
      }
      if (const Status status = known(middle, velocity, left); status != Status::kOk) {
        return status;
      }
      const AlignedMotion before = *this;
      Status status = motion_.update(middle, dt);
      status = status == Status::kOk ? reference_.update(wanted, dt) : status;
      status = status == Status::kOk ? sign_.update(sign, dt) : status;
      status = status == Status::kOk ? torque_.update(left, dt) : status;
      if (status != Status::kOk) {
        *this = before;
        return status;
      }
    }
    last_q_ = q;
    last_qd_ = qd;
    last_q_ref_ = q_ref;
    started_ = true;
    return Status::kOk;
  }

  /// The same with nothing to take off.
  Status update(const Vector& q, const Vector& qd, const Vector& q_ref, const Vector& tau,
                Scalar dt) noexcept {
    return update(q, qd, q_ref, tau, dt, [](const Vector&, const Vector&, Vector&) { return Status::kOk; });
  }

  /// The start-up transient has died away.
  bool settled() const noexcept { return motion_.settled(); }

  const Vector& q() const noexcept { return motion_.value(); }
  const Vector& qd() const noexcept { return motion_.derivative(); }
  const Vector& qdd() const noexcept { return motion_.second_derivative(); }
  /// Acceleration of the reference: free of the encoders' noise, an instrument.
  const Vector& qdd_ref() const noexcept { return reference_.second_derivative(); }
  const Vector& sign() const noexcept { return sign_.value(); }
  const Vector& tau() const noexcept { return torque_.value(); }

 private:
  using Filter = StateVariableFilter<Scalar, N>;

  Filter motion_, reference_, sign_, torque_;
  Vector last_q_ = Vector::Zero(), last_qd_ = Vector::Zero(), last_q_ref_ = Vector::Zero();
  Scalar sign_width_{0};
  bool started_{false};
};

}  // namespace heft
