/// @file
/// The load of an arm while it moves, sample by sample.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/status.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/robot.hpp"
#include "heft/sim/controller.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/track/controllers.hpp"
#include "model_feed_forward.hpp"

namespace heft::track {

/// Slower than this the sign of friction is not known [rad/s, m/s].
inline constexpr double kUncertainSpeed = 0.06;

/// The load, sample by sample: filters, residual of the nominal arm, recursion, change detection.
///
/// Motion comes from encoder positions through the state-variable filter; the torque, less the friction, couplings and
/// effects that the nominal arm predicts, passes the same filter and keeps the same delay. Friction is subtracted before
/// the filter because a filtered sign is not the sign of a filtered velocity.
template <int N>
class LoadObserver {
 public:
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;
  using Estimator = PayloadEstimator<double, N>;
  using Recursion = typename Estimator::Estimator;

  /// @param nominal  the arm without load
  /// @param trace    gets the estimate over time; may be null
  /// @throws ModelError for settings outside their ranges
  LoadObserver(const model::Robot& nominal, const ControllerSettings& settings,
               std::shared_ptr<LoadTrace> trace)
      : settings_(settings),
        arm_(model::to_arm_model<N>(nominal)),
        trace_(std::move(trace)),
        couplings_(nominal.couplings),
        state_(effects_of<N>(nominal)) {
    double weight = 0, reach = 0;
    for (const model::RobotJoint& joint : nominal.joints) {
      weight += joint.link[kMass];
      reach += std::hypot(joint.joint.position[0], joint.joint.position[1], joint.joint.position[2]);
    }
    const double mass_prior = settings.mass_prior > 0 ? settings.mass_prior : std::max(0.01, weight / 3);
    typename Estimator::Config config;
    config.first_row = settings.rows - 1;
    config.mass_prior = mass_prior;
    config.length_prior = std::max(0.02, 0.1 * reach);
    farthest_ = std::max(0.1, 0.5 * reach);
    config.gate = 0;
    config.forgetting_factor = 1.0;  // a change starts it again
    config.sign_width = kSignWidth;
    // How much of the last joint's friction a load may change: half of what it has.
    const auto& last = nominal.joints.back().actuation;
    config.friction_prior = std::max(1e-6, 0.5 * last.coulomb_friction);
    for (int i = 0; i < N; ++i) {
      const auto& actuation = nominal.joints[static_cast<std::size_t>(i)].actuation;
      const double guess = settings.noise.size() == N
                               ? settings.noise[i]
                               : 0.05 * actuation.coulomb_friction + 2e-4 * 9.81 * weight;
      noise_[i] = std::max(guess, 1e-9);
      config.noise_std[i] = noise_[i];
    }
    state_.variance = noise_.cwiseAbs2();
    if (state_.estimator.configure(config) != Status::kOk ||
        state_.motion.configure(settings.filter_hz) != Status::kOk ||
        state_.torque.configure(settings.filter_hz) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: estimator settings k = {}, filter {} Hz, mass prior {} kg: expected k from "
                      "1 to {} and positive values",
                      settings.rows, settings.filter_hz, mass_prior, N));
    }
    // As configured, for starting again: the factors are still diagonal.
    for (int i = 0; i < Estimator::kParameters; ++i) {
      prior_variance_[static_cast<std::size_t>(i)] = state_.estimator.estimator().variance(i);
    }
    settle_time_ = 10.0 / (2.0 * std::numbers::pi * settings.filter_hz);
    state_.quiet_until = 2 * settle_time_;
  }

  /// The load that the model is to carry, in the last link frame.
  const InertialParameters<double>& load() const { return state_.carried; }
  /// The estimate and the variance of parameter i, see PayloadEstimator.
  const Estimator& estimator() const { return state_.estimator; }

  /// Takes a sample.
  /// @return kNonFiniteInput, kOutOfRange: the sample is refused and leaves no trace
  Status sample(const sim::Measurement& m) {
    elapsed_ += m.sample_time;
    const State before = state_;
    const Status status = take(m);
    if (status == Status::kOk) {
      elapsed_ = 0;
    } else {
      state_ = before;
    }
    return status;
  }

 private:
  /// Everything that a sample changes.
  struct State {
    explicit State(const EffectFeedForward<double, N, kMaxEffects>& model_effects) : effects(model_effects) {}

    EffectFeedForward<double, N, kMaxEffects> effects;
    Estimator estimator;
    StateVariableFilter<double, N> motion, torque;
    Vector variance = Vector::Ones();
    Vector power = Vector::Zero(), product = Vector::Zero(), last_innovation = Vector::Zero(),
           learned = Vector::Zero();
    Vector doubt = Vector::Ones();
    Vector previous_q = Vector::Zero(), previous_qd = Vector::Zero();
    InertialParameters<double> carried{};
    double quiet_until{0}, surprise{1}, unexplained{0}, whole{0};
    long count{0};
    int decimation{1}, since_reset{0};
    bool started{false}, reset_due{false};
  };

  Status take(const sim::Measurement& m) {
    State& s = state_;
    const Vector q = m.q, qd = m.qd, tau = m.tau;
    if (!all_usable(q) || !all_usable(qd)) return Status::kNonFiniteInput;
    if (!s.started) {
      s.previous_q = q;
      s.previous_qd = qd;
      s.started = true;
      s.decimation =
          std::max(1, static_cast<int>(std::lround(1.0 / (m.sample_time * settings_.update_rate))));
      return Status::kOk;
    }
    // The reported torque acted between the two samples: everything is taken half-way.
    const Vector middle_q = 0.5 * (q + s.previous_q);
    const Vector middle_qd = 0.5 * (qd + s.previous_qd);
    s.previous_q = q;
    s.previous_qd = qd;
    Vector rigid = tau;
    const double forget = std::exp(-elapsed_ * 2 * std::numbers::pi * settings_.filter_hz / 3);
    for (int i = 0; i < N; ++i) {
      // Around a reversal and at rest friction is anything between its two levels; the filter remembers that.
      s.doubt[i] = std::abs(middle_qd[i]) < kUncertainSpeed ? 1.0 : s.doubt[i] * forget;
      rigid[i] -= friction_torque(actuation(i), middle_qd[i], kSignWidth);
    }
    if (s.effects.count() > 0 || !couplings_.empty()) {
      const Vector zero = Vector::Zero();
      Vector known = zero;
      add_couplings(couplings_, middle_qd, zero, known);
      const Vector load = inverse_dynamics(arm_, middle_q, middle_qd, zero);
      if (const Status status = s.effects.add_torque(m.time, middle_q, middle_qd, zero, load,
                                                     arm_.model().actuation, kSignWidth, known);
          status != Status::kOk)
        return status;
      rigid -= known;
    }
    if (const Status status = s.motion.update(middle_q, elapsed_); status != Status::kOk) return status;
    if (const Status status = s.torque.update(rigid, elapsed_); status != Status::kOk) return status;
    return ++s.count % s.decimation != 0 ? Status::kOk : estimate(m.time);
  }

  Status estimate(double time) {
    State& s = state_;
    const Vector& q = s.motion.value();
    const Vector& qd = s.motion.derivative();
    const Vector& qdd = s.motion.second_derivative();
    const Vector residual = residual_at(q, qd, qdd);
    if (time < s.quiet_until) {
      record(time);
      return Status::kOk;
    }
    if (s.reset_due) {
      // The filters hold the new load only from here on. Nothing is known of it; the model keeps the old one until
      // something is.
      static_cast<void>(s.estimator.estimator().configure({}, {}, prior_variance_));
      s.reset_due = false;
      s.since_reset = 0;
      s.surprise = 1;
      s.unexplained = s.whole = 0;
    }
    LinkRegressor<double, N> Y;
    link_regressor(arm_, joint_trigonometry<Arm>(q), q, qd, qdd, Y);
    double ratio = 0, unexplained = 0, whole = 0;
    for (int i = settings_.rows - 1; i < N; ++i) {
      const typename Recursion::Row row = s.estimator.row(Y, qd, i);
      typename Recursion::Record taken;
      const double friction = 0.5 * s.doubt[i] * actuation(i).coulomb_friction;
      const double variance = s.variance[i] + friction * friction;
      if (const Status status = s.estimator.estimator().update(row, residual[i], variance, taken);
          status != Status::kOk)
        return status;
      unexplained += taken.innovation * taken.innovation / variance;
      whole += residual[i] * residual[i] / variance;
      // Limited, so that one outlier alone cannot look like another load.
      ratio += std::min(200.0, taken.innovation * taken.innovation / taken.innovation_variance);
      if (s.doubt[i] < 0.1) learn_noise(i, taken);
    }
    ratio /= N - settings_.rows + 1;
    // Innovations several times their size over some updates: another load.
    s.surprise += 0.2 * (ratio - s.surprise);
    ++s.since_reset;
    s.unexplained += 0.02 * (unexplained - s.unexplained);
    s.whole += 0.02 * (whole - s.whole);
    // Loads do not come and go several times a second: such a change is something that no load explains.
    const bool changed = s.surprise > 20 && s.since_reset > 100;
    if (changed) {
      s.quiet_until = time + settle_time_;
      s.reset_due = true;
    }
    carry();
    if (changed && trace_) trace_->change.push_back(time);
    record(time);
    return Status::kOk;
  }

  /// Filtered torque that the nominal arm does not explain.
  Vector residual_at(const Vector& q, const Vector& qd, const Vector& qdd) const {
    Vector residual = state_.torque.value() - inverse_dynamics(arm_, q, qd, qdd);
    for (int i = 0; i < N; ++i) residual[i] -= actuation(i).rotor_inertia * qdd[i];
    for (const GearCoupling<double>& coupling : couplings_) {
      const double shared =
          coupling.rotor_inertia * shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
      residual[coupling.driven] -= shared;
      residual[coupling.driving] -= coupling.ratio * shared;
    }
    return residual;
  }

  /// The residual's size and correlation, slowly, from innovations limited to three standard deviations.
  void learn_noise(int i, const typename Recursion::Record& taken) {
    State& s = state_;
    if (s.since_reset < 20) return;
    const double size = std::sqrt(taken.innovation_variance);
    const double cut = std::clamp(taken.innovation, -3 * size, 3 * size);
    const double share = std::max(1.0 / (1.0 + s.learned[i]), 0.01);
    s.learned[i] += 1;
    s.power[i] += share * (cut * cut - s.power[i]);
    s.product[i] += share * (cut * s.last_innovation[i] - s.product[i]);
    s.last_innovation[i] = cut;
    if (s.learned[i] > 30) s.variance[i] = std::max(s.power[i], 0.25 * noise_[i] * noise_[i]);
  }

  /// How much wider the intervals are than those of white residuals: (1 + ρ)/(1 − ρ) of a first-order process.
  double widening() const {
    double factor = 0;
    for (int i = settings_.rows - 1; i < N; ++i) {
      const double rho =
          state_.power[i] > 0 ? std::clamp(state_.product[i] / state_.power[i], 0.0, 0.95) : 0.0;
      factor = std::max(factor, (1 + rho) / (1 - rho));
    }
    return std::sqrt(factor);
  }

  /// Hands the estimate to the model, gradually, once enough samples have gone into it; a load whose mass cannot be
  /// distinguished from zero is none.
  void carry() {
    State& s = state_;
    if (s.since_reset < 12) return;
    InertialParameters<double> load = s.estimator.payload();
    if (load[kMass] < 4 * widening() * s.estimator.standard_deviation(0) || s.unexplained > 0.5 * s.whole)
      load = {};
    make_physical(load);
    for (std::size_t i = 0; i < load.size(); ++i) s.carried[i] += 0.2 * (load[i] - s.carried[i]);
  }

  /// Nearest load that is a body: centre of mass within reach, moments of inertia about it that a body can have. Early
  /// estimates need not be one, and feedback through an impossible inertia is unstable.
  void make_physical(InertialParameters<double>& p) const {
    const double m = p[kMass];
    if (!(m > 0)) {
      p = {};
      return;
    }
    Eigen::Vector3d c(p[kMcx] / m, p[kMcy] / m, p[kMcz] / m);
    const bool far = c.norm() > farthest_;
    if (far) c *= farthest_ / c.norm();
    const Eigen::Matrix3d steiner = m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
    Eigen::Matrix3d about;
    about << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
    const Eigen::Matrix3d central = about - steiner;
    // Second moments ½ tr(I) E − I: none below zero, none beyond the farthest point.
    const Eigen::Matrix3d second = 0.5 * central.trace() * Eigen::Matrix3d::Identity() - central;
    const Eigensystem principal = eigensystem_of(second);
    const Eigen::Vector3d moments = principal.values.cwiseMax(0.0).cwiseMin(m * farthest_ * farthest_ / 4);
    const Eigen::Matrix3d axes = principal.vectors;
    const Eigen::Matrix3d cleaned = axes * moments.asDiagonal() * axes.transpose();
    const Eigen::Matrix3d inertia = cleaned.trace() * Eigen::Matrix3d::Identity() - cleaned + steiner;
    p = {m,
         m * c[0],
         m * c[1],
         m * c[2],
         inertia(0, 0),
         inertia(0, 1),
         inertia(1, 1),
         inertia(0, 2),
         inertia(1, 2),
         inertia(2, 2)};
  }

  void record(double time) {
    if (!trace_) return;
    const State& s = state_;
    const InertialParameters<double> load = s.estimator.payload();
    const double wide = statistics::kNormal95 * widening();
    const bool unclear = s.reset_due || time < s.quiet_until;
    const double half = unclear ? kNaN : wide * s.estimator.standard_deviation(0);
    trace_->time.push_back(time);
    trace_->mass.push_back(unclear ? kNaN : load[kMass]);
    trace_->mass_half_width.push_back(half);
    std::array<double, 3> com{kNaN, kNaN, kNaN}, com_half{kNaN, kNaN, kNaN};
    if (std::abs(load[kMass]) > 3 * half) {
      for (std::size_t a = 0; a < 3; ++a) {
        com[a] = load[kMcx + a] / load[kMass];
        typename Recursion::Row row{};
        row[kMass] = -com[a] / load[kMass];
        row[kMcx + a] = 1 / load[kMass];
        com_half[a] = wide * std::sqrt(s.estimator.estimator().variance(row));
      }
    }
    trace_->com.push_back(com);
    trace_->com_half_width.push_back(com_half);
  }

  const JointActuation<double>& actuation(int i) const {
    return arm_.model().actuation[static_cast<std::size_t>(i)];
  }

  ControllerSettings settings_;
  Arm arm_;
  std::shared_ptr<LoadTrace> trace_;
  std::vector<GearCoupling<double>> couplings_;
  typename Estimator::Row prior_variance_{};
  Vector noise_ = Vector::Ones();
  double settle_time_{0}, farthest_{0.5};
  State state_;
  double elapsed_{0};  ///< since the last sample taken [s]
};

}  // namespace heft::track
