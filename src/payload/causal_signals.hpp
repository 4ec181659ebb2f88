/// @file
/// Log samples as a controller sees them: one after the other, through causal low-passes.
///
/// Two filters in series. A fast one takes torque and positions alike, and its states are velocity and
/// acceleration. At that motion the regressor is taken, and the torque and every column of the regressor go
/// through the slow one, whose cut-off is the one asked for. So all columns pass the same filters as the
/// torque: rotor inertia, viscous, offset and Coulomb (whose sign goes through the fast filter as well)
/// exactly, the inertial ones, not linear in q, up to 3 (q̇/ω)²/2 of the torque with ω the fast pole: 0.06
/// % at 1 rad/s and 8 Hz. One slow filter on the motion alone would save n (14 n + 1) filters, but the same
/// error at 3 Hz is 0.4 % of the torque of the whole arm, as much as a light load.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <Eigen/Core>

#include "beyond_regressor.hpp"
#include "heft/core/arm_geometry.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/predict.hpp"
#include "row_limits.hpp"

namespace heft::payload {

/// Width of the sign where the velocity is the difference of two positions, noisier than one that was measured [rad/s].
inline constexpr double kDifferencedSignWidth = 0.01;

/// Pole of the fast filter over that of the slow one.
inline constexpr double kFastPole = 5.0;
/// Largest fast pole over the sample rate. The filter sees straight lines between samples; the second
/// derivative feels their corners by 2 (1 + (f_s/f)²)^(-3/2): 0.2 % at a tenth of the rate, 3 % at a
/// quarter.
inline constexpr double kFastest = 0.1;

/// Pole of the fast filter [Hz].
inline double fast_pole(double cutoff, double sample_rate) {
  return std::max(cutoff, std::min(kFastPole * cutoff, kFastest * sample_rate));
}

/// What became of a sample.
enum class Taken {
  kRefused,   ///< implausible: nothing changed
  kSettling,  ///< taken, but the filters have not settled
  kReady      ///< regressor() and tau() hold the answer
};

template <int N>
class CausalSignals {
 public:
  using Vector = JointVector<double, N>;
  using Regressor = Eigen::Matrix<double, N, 14 * N>;

  /// @param dynamics     of the robot whose limits say what is plausible; must outlive this
  /// @param cutoff       of the slow filter [Hz]
  /// @param sample_rate  [Hz]
  CausalSignals(const model::Dynamics& dynamics, double cutoff, double sample_rate)
      : dynamics_(dynamics),
        limits_(dynamics.robot()),
        beyond_(dynamics.robot()),
        columns_(std::make_unique<StateVariableFilter<double, N * 14 * N>>()) {
    const double fast = fast_pole(cutoff, sample_rate);
    configured_ = motion_.configure(fast) == Status::kOk && torque_.configure(fast) == Status::kOk &&
                  sign_.configure(fast) == Status::kOk && columns_->configure(cutoff) == Status::kOk &&
                  slow_torque_.configure(cutoff) == Status::kOk;
  }

  /// Takes row k of a log that holds torque, always of the same log.
  Taken take(const data::Log& log, Eigen::Index k) {
    const Vector q = log.q.row(k).transpose();
    const Vector tau = log.tau.row(k).transpose();
    const double time = log.time[k];
    const double period = time - time_;
    const Vector step = started_ ? Vector(q - position_) : Vector(Vector::Zero());
    const bool measured = log.qd.cols() == N;
    const Vector qd = measured ? Vector(log.qd.row(k).transpose()) : Vector(Vector::Zero());
    if (limits_.implausible_joint(q, qd, tau, step, started_ ? period : 0.0) >= 0) return Taken::kRefused;
    Vector sign;
    for (int i = 0; i < N; ++i) {
      sign[i] = measured ? velocity_sign(qd[i], validate::kSignWidth)
                         : velocity_sign(started_ ? step[i] / period : 0.0, kDifferencedSignWidth);
    }
    if (!configured_ || motion_.update(q, period) != Status::kOk ||
        torque_.update(tau, period) != Status::kOk || sign_.update(sign, period) != Status::kOk) {
      return Taken::kRefused;
    }
    position_ = q;
    time_ = time;
    started_ = true;
    // After a gap the fast filters restart. Until they have settled the slow ones wait: to them the time
    // between is a straight line, in the torque as in the columns.
    if (!motion_.settled()) return Taken::kSettling;
    regressor_ = dynamics_.regressor(motion_.value(), motion_.derivative(), motion_.second_derivative());
    for (int i = 0; i < N; ++i) regressor_(i, 11 * N + i) = sign_.value()[i];
    Vector linear = torque_.value();
    if (beyond_.any()) {
      // At the motion behind the fast filter, as the columns are: a sign that turns over there has moved a torque by the
      // same delay as the filter of the torque, and the slow filter takes off the difference in shape.
      linear -= beyond_.torque(time - log.time[0], motion_.value(), motion_.derivative(),
                               motion_.second_derivative(), validate::kSignWidth);
      regressor_.template leftCols<10 * N>() =
          dynamics_.regressor(beyond_.link_q(), beyond_.link_qd(), beyond_.link_qdd()).leftCols(10 * N);
    }
    const double slow_period = time - slow_time_;
    slow_time_ = time;
    if (columns_->update(Eigen::Map<const Eigen::Matrix<double, N * 14 * N, 1>>(regressor_.data()),
                         slow_period) != Status::kOk ||
        slow_torque_.update(linear, slow_period) != Status::kOk) {
      return Taken::kRefused;
    }
    return columns_->settled() ? Taken::kReady : Taken::kSettling;
  }

  /// Filtered regressor, n × 14n, all blocks as in model::Dynamics::regressor.
  Eigen::Map<const Regressor> regressor() const {
    return Eigen::Map<const Regressor>(columns_->value().data());
  }
  /// Filtered torque, less what the robot's own torque holds beyond its 14 n parameters [N·m, N].
  const Vector& tau() const { return slow_torque_.value(); }
  /// Filtered velocity of joint i and filtered sign of it: the viscous and the Coulomb column.
  double velocity(int i) const { return regressor()(i, 12 * N + i); }
  double sign(int i) const { return regressor()(i, 11 * N + i); }

 private:
  const model::Dynamics& dynamics_;
  RowLimits limits_;
  BeyondRegressor beyond_;
  StateVariableFilter<double, N> motion_, torque_, sign_, slow_torque_;
  std::unique_ptr<StateVariableFilter<double, N * 14 * N>> columns_;
  Regressor regressor_;
  Vector position_ = Vector::Zero();
  double time_{0.0}, slow_time_{0.0};
  bool started_{false};
  bool configured_{false};
};

}  // namespace heft::payload
