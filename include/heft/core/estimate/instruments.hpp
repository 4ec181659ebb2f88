/// @file
/// Accelerations to make instruments from: correlated with the true one, free of the noise of this sample's
/// measurement (Kawasaki and Nishimura, (34), (35) and the text after them).
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// The per-joint instrumental model (35): acceleration from the actuator input u by
/// â(j) = −a⁰ â(j−1) + b⁰ (u(j) − u(j−1)).
///
/// A joint J q̈ + D q̇ = K u has the transfer K s / (J s + D) from u to q̈; with c = D/J and the bilinear transform
/// a⁰ = −(1 − c Δt/2) / (1 + c Δt/2), b⁰ = (K/J) / (1 + c Δt/2), b¹ = −b⁰. The sign terms of friction are not in it.
template <typename Scalar, int N>
class JointAccelerationModel {
 public:
  using Vector = JointVector<Scalar, N>;

  struct Config {
    Vector gain = Vector::Ones();              ///< K/J of each joint, > 0 [rad/s² per unit of u]
    Vector decay = Vector::Ones();             ///< c = D/J of each joint, ≥ 0 [1/s]
    Scalar period{static_cast<Scalar>(1e-3)};  ///< Δt > 0 [s]
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    if (!(config.period > Scalar(0)) || !is_usable(config.period)) {
      return Status::kOutOfRange;
    }
    for (int i = 0; i < N; ++i) {
      if (!(config.gain[i] > Scalar(0)) || !(config.decay[i] >= Scalar(0)) || !is_usable(config.gain[i]) ||
          !is_usable(config.decay[i])) {
        return Status::kOutOfRange;
      }
    }
    for (int i = 0; i < N; ++i) {
      const Scalar half = config.decay[i] * config.period * static_cast<Scalar>(0.5);
      a_[i] = -(Scalar(1) - half) / (Scalar(1) + half);
      b_[i] = config.gain[i] / (Scalar(1) + half);
    }
    reset();
    return Status::kOk;
  }

  /// Forgets the past; the next input is taken as having been constant before.
  void reset() noexcept {
    acceleration_.setZero();
    started_ = false;
  }

  /// The modelled acceleration at this sample.
  /// @param u  actuator inputs, n; must not contain measured accelerations. One with a number that is not finite or
  ///           beyond kLargestInput is left out: the acceleration remains what it was
  const Vector& update(const Vector& u) noexcept {
    if (!all_usable(u)) {
      return acceleration_;
    }
    if (started_) {
      for (int i = 0; i < N; ++i) {
        acceleration_[i] = b_[i] * (u[i] - previous_[i]) - a_[i] * acceleration_[i];
      }
    }
    previous_ = u;
    started_ = true;
    return acceleration_;
  }

 private:
  Vector a_ = Vector::Zero(), b_ = Vector::Zero();
  Vector acceleration_ = Vector::Zero(), previous_ = Vector::Zero();
  bool started_{false};
};

/// Mean of earlier measured accelerations, the newest of them `gap` samples old.
///
/// White acceleration noise asks for a gap of 1; doubly differenced encoders, whose noise is correlated over
/// neighbours, for 3 at least.
/// @tparam Depth  most samples kept: gap + count ≤ Depth
template <typename Scalar, int N, int Depth>
class DelayedMean {
 public:
  using Vector = JointVector<Scalar, N>;

  /// @param gap    age of the newest sample in the mean, ≥ 1
  /// @param count  samples in the mean, ≥ 1
  Status configure(int gap, int count) noexcept {
    if (gap < 1 || count < 1 || gap + count > Depth) {
      return Status::kOutOfRange;
    }
    gap_ = gap;
    count_ = count;
    filled_ = 0;
    head_ = 0;
    return Status::kOk;
  }

  /// True once enough samples are in.
  bool ready() const noexcept { return filled_ >= gap_ + count_ - 1; }

  /// The mean before this sample goes in, zero while not ready(); then stores the sample. A sample that is not finite
  /// shows in the means of the next `gap` + `count` samples, which the estimator refuses, and in no later one.
  Vector update(const Vector& measured) noexcept {
    Vector mean = Vector::Zero();
    if (ready()) {
      for (int k = 0; k < count_; ++k) {
        mean += history_[index(gap_ + k)];
      }
      mean *= Scalar(1) / static_cast<Scalar>(count_);
    }
    history_[static_cast<std::size_t>(head_)] = measured;
    head_ = head_ + 1 == Depth ? 0 : head_ + 1;
    filled_ = filled_ < Depth ? filled_ + 1 : Depth;
    return mean;
  }

 private:
  std::size_t index(int age) const noexcept {
    const int i = head_ - age;
    return static_cast<std::size_t>(i < 0 ? i + Depth : i);
  }

  std::array<Vector, Depth> history_{};
  int gap_{1}, count_{1}, filled_{0}, head_{0};
};

/// Acceleration the model predicts from the motor torque: q̈ = M⁻¹(τ − bias − friction) with the running estimate.
/// Costs a mass matrix, a bias torque and a Cholesky factorisation a sample.
///
/// @param parameters  reduced parameters with the running estimate
/// @param rotor       reflected rotor inertias, n
/// @param tau         motor torque less friction, n
/// @return kNotPositiveDefinite, acceleration unchanged: the estimate is not physical at this pose
template <typename Arm, typename Parameters>
inline Status predicted_acceleration(const Parameters& parameters, const JointTrigonometry<Arm>& trig,
                                     const typename Arm::Vector& q, const typename Arm::Vector& qd,
                                     const typename Arm::Vector& rotor, const typename Arm::Vector& tau,
                                     typename Arm::Vector& acceleration) noexcept {
  using Scalar = typename Arm::Scalar;
  MassMatrix<Scalar, Arm::kNumJoints> mass;
  typename Arm::Vector bias;
  mass_matrix<Arm>(parameters, trig, q, mass);
  bias_torque<Arm>(parameters, trig, q, qd, bias);
  return forward_dynamics<Scalar, Arm::kNumJoints>(mass, bias, rotor, tau, acceleration);
}

}  // namespace heft
