#include "balance.hpp"

#include <algorithm>
#include <utility>

#include "core_settings.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/monitor/contact_deviation.hpp"
#include "heft/core/monitor/momentum_observer.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/sized.hpp"
#include "heft/statistics/median.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// A gap of that many periods restarts the observer.
constexpr double kLongestGap = 10.0;
/// Bandwidth at which the observer passes the torque from outside on as it is [1/s].
constexpr double kUnfiltered = 1e5;

template <int N>
Index fill(const model::Robot& robot, const Signals& signals, Balance& balance) {
  using Vector = JointVector<double, N>;
  const DynamicArm<double, N> arm(model::to_arm_model<N>(robot));
  MomentumObserver<double, N> observer;
  typename MomentumObserver<double, N>::Config config;
  config.bandwidth = kUnfiltered;
  config.motor_inertia = motor_inertia_of(robot);
  config.longest_period = balance.longest_period;
  if (observer.configure(config) != Status::kOk)
    throw Error("monitor: the momentum observer refuses its settings");
  LagrangianTerms<double, N> terms;
  Index taken = 0;
  double last = signals.time[0];
  for (Index k = 0; k < signals.time.size(); ++k) {
    const Vector q = signals.q.row(k), qd = signals.qd.row(k);
    lagrangian_terms(arm, joint_trigonometry<DynamicArm<double, N>>(q), q, qd, terms);
    const double period = signals.time[k] - last;
    if (observer.update(terms, qd, signals.tau.row(k), signals.friction.row(k), period) != Status::kOk)
      continue;
    last = signals.time[k];
    if (!observer.running()) continue;
    balance.time[taken] = last;
    balance.period[taken] = period;
    balance.outside.row(taken) = observer.residual();
    balance.explained.row(taken) = observer.explained();
    balance.qd.row(taken) = qd;
    ++taken;
  }
  return taken;
}

template <int N>
void fill(const Balance& balance, const Thresholds& thresholds, Deviations& found) {
  ContactDeviation<double, N> core;
  core.configure(sized_thresholds<N>(thresholds));
  typename ContactDeviation<double, N>::Record record{};
  double settled = 0.0;
  for (Index k = 0; k < balance.time.size(); ++k) {
    if (k > 0 && balance.time[k] - balance.time[k - 1] > balance.longest_period) {
      core.restart();
      settled = 0.0;
    }
    core.update(balance.outside.row(k), balance.explained.row(k), balance.qd.row(k), balance.period[k], 0.0,
                record);
    found.level.row(k) = (record.residual.array() / record.level_threshold.array()).abs();
    // Thresholds hold for friction that takes up no load as well.
    found.change.row(k) = ((record.change + record.taken_up).array() / record.change_threshold.array()).abs();
    for (Index j = 0; j < found.phase.cols(); ++j)
      found.phase(k, j) = static_cast<int>(record.phase[static_cast<std::size_t>(j)]);
    found.load_rate[k] = core.load_rate();
    found.judged[static_cast<std::size_t>(k)] = settled >= core.kSettling / thresholds.adaptation;
    settled += balance.period[k];
  }
}

}  // namespace

double longest_period(double period) { return std::clamp(kLongestGap * period, 0.1, 1000.0); }

Eigen::MatrixXd motor_inertia_of(const model::Robot& robot) {
  const int n = robot.num_joints();
  Eigen::MatrixXd inertia = Eigen::MatrixXd::Zero(n, n);
  for (int j = 0; j < n; ++j)
    inertia(j, j) = robot.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia;
  for (const Elasticity<double>& e : robot.elasticities) inertia(e.joint, e.joint) += e.motor_inertia;
  for (const JointEffect<double>& effect : robot.effects) {
    if (effect.kind == joint_effect_kind<RotorInertia>())
      inertia(effect.joint, effect.joint) += effect.parameters[0];
  }
  for (const GearCoupling<double>& c : robot.couplings) {
    inertia(c.driven, c.driven) += c.rotor_inertia;
    inertia(c.driven, c.driving) += c.ratio * c.rotor_inertia;
    inertia(c.driving, c.driven) += c.ratio * c.rotor_inertia;
    inertia(c.driving, c.driving) += c.ratio * c.ratio * c.rotor_inertia;
  }
  return inertia;
}

Balance balance_of(const model::Robot& robot, const Signals& signals) {
  const Index samples = signals.q.rows(), n = signals.q.cols();
  Balance balance;
  balance.longest_period = longest_period(median_period(signals.time));
  for (Eigen::VectorXd* vector : {&balance.time, &balance.period}) vector->setZero(samples);
  for (Eigen::MatrixXd* matrix : {&balance.outside, &balance.explained, &balance.qd})
    matrix->setZero(samples, n);
  const Index taken = model::with_joint_count(robot.num_joints(), robot.name, [&](auto size) {
    return fill<decltype(size)::value>(robot, signals, balance);
  });
  for (Eigen::VectorXd* vector : {&balance.time, &balance.period}) vector->conservativeResize(taken);
  for (Eigen::MatrixXd* matrix : {&balance.outside, &balance.explained, &balance.qd})
    matrix->conservativeResize(taken, n);
  return balance;
}

Deviations deviations_of(const Balance& balance, const Thresholds& thresholds) {
  const Index samples = balance.time.size(), n = balance.outside.cols();
  Deviations found;
  for (Eigen::MatrixXd* matrix : {&found.level, &found.change}) matrix->setZero(samples, n);
  found.phase.setZero(samples, n);
  found.load_rate.setZero(samples);
  found.judged.assign(static_cast<std::size_t>(samples), 0);
  model::with_joint_count(static_cast<int>(n), "of the log", [&](auto size) {
    fill<decltype(size)::value>(balance, thresholds, found);
    return 0;
  });
  return found;
}

}  // namespace heft::monitor
