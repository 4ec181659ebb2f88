/// @file
/// Log samples as a controller sees them: one after the other, through the causal low-pass.
///
/// Torque and motion go through the same third-order filter, of which velocity and acceleration are states. Then
/// every column that is linear in them (rotor inertia, viscous, offset, and Coulomb, whose sign is filtered as
/// well) is filtered exactly as the torque is. The inertial columns are not linear in q; taking them at the filtered
/// motion instead of filtering them leaves an error of the order of 3 (q̇/ω)²/2 of the torque, ω the filter's pole:
/// 0.2 % at 1 rad/s and 5 Hz. Filtering all columns would cost 14 n² filters in place of 3 n.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/data/log.hpp"
#include "heft/model/robot.hpp"

namespace heft::identify {

/// Half-width of the sign where the log holds a velocity, and where it is differenced from positions [rad/s].
inline constexpr double kMeasuredSignWidth = 0.005;
inline constexpr double kDerivedSignWidth = 0.03;

/// Widest plausible sample: beyond these multiples of the URDF's limits it is taken as a fault of the measurement.
inline constexpr double kImplausibleTorque = 5.0;
inline constexpr double kImplausibleVelocity = 5.0;

template <int N>
class CausalSignals {
 public:
  using Vector = JointVector<double, N>;

  CausalSignals(const model::Robot& robot, double cutoff) {
    for (int i = 0; i < N; ++i) {
      torque_limit_[i] = kImplausibleTorque * robot.joints[static_cast<std::size_t>(i)].effort_limit;
      velocity_limit_[i] = kImplausibleVelocity * robot.joints[static_cast<std::size_t>(i)].velocity_limit;
    }
    status_ = motion_.configure(cutoff);
    static_cast<void>(torque_.configure(cutoff));
    static_cast<void>(sign_.configure(cutoff));
  }

  /// Takes row k of a log that holds torque. @return false, nothing changed: the sample is implausible.
  bool take(const data::Log& log, Eigen::Index k) {
    const Vector q = log.q.row(k).transpose();
    const Vector tau = log.tau.row(k).transpose();
    const double period = log.time[k] - time_;
    const bool first = !started_;
    Vector qd = Vector::Zero();
    for (int i = 0; i < N; ++i) {
      if (!std::isfinite(q[i]) || !std::isfinite(tau[i]) || std::abs(tau[i]) > torque_limit_[i]) return false;
      const double step = first ? 0.0 : (q[i] - position_[i]) / period;
      if (std::abs(step) > velocity_limit_[i]) return false;
      qd[i] = log.qd.cols() == N ? log.qd(k, i) : step;
      if (!std::isfinite(qd[i]) || std::abs(qd[i]) > velocity_limit_[i]) return false;
    }
    const double width = log.qd.cols() == N ? kMeasuredSignWidth : kDerivedSignWidth;
    Vector sign;
    for (int i = 0; i < N; ++i) sign[i] = velocity_sign(qd[i], width);
    // After a long gap each filter starts anew by itself and settled() turns false.
    if (motion_.update(q, period) != Status::kOk || torque_.update(tau, period) != Status::kOk ||
        sign_.update(sign, period) != Status::kOk) {
      return false;
    }
    position_ = q;
    time_ = log.time[k];
    started_ = true;
    return true;
  }

  bool settled() const { return status_ == Status::kOk && motion_.settled(); }
  const Vector& q() const { return motion_.value(); }
  const Vector& qd() const { return motion_.derivative(); }
  const Vector& qdd() const { return motion_.second_derivative(); }
  const Vector& sign() const { return sign_.value(); }
  const Vector& tau() const { return torque_.value(); }

 private:
  StateVariableFilter<double, N> motion_, torque_, sign_;
  Vector torque_limit_, velocity_limit_, position_ = Vector::Zero();
  double time_{0.0};
  bool started_{false};
  Status status_{Status::kNotConfigured};
};

/// Writes the filtered signs in place of the sharp ones into the Coulomb columns of a full regressor, n × 14n.
template <typename Matrix, typename Vector>
void set_coulomb_columns(Matrix& Y, const Vector& sign) {
  const Eigen::Index n = Y.rows();
  for (Eigen::Index i = 0; i < n; ++i) Y(i, 11 * n + i) = sign[i];
}

}  // namespace heft::identify
