#include "causal_run.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/core/effects/effects.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/sized.hpp"
#include "heft/statistics/median.hpp"
#include "heft/validate/predict.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// Poles of the low-pass that gives velocity where the log has none [Hz]; delay 16 ms. Half of it leaves twice the delay,
/// twice of it eight times the noise of a coarse encoder.
constexpr double kVelocityPole = 30.0;
/// Above any torque that core accepts to compare.
constexpr double kOpen = 1e30;

/// A gap of that many periods restarts the observer.
constexpr double kLongestGap = 10.0;

/// Width of friction's sign [rad/s, m/s]: a joint that rests while others move rattles by some mrad/s, and friction that
/// turned round with that would hide a touch (10 N·m on the first joint of a UR10e).
constexpr double kSignWidth = 0.01;

/// Positions and velocities behind a causal low-pass, and the torque behind the same, so that both are equally late.
void derive_velocity(const std::string& robot, const data::Log& log, Signals& signals) {
  model::with_joint_count(log.num_joints(), robot, [&](auto size) {
    constexpr int kN = decltype(size)::value;
    StateVariableFilter<double, kN> position, torque;
    if (position.configure(kVelocityPole) != Status::kOk || torque.configure(kVelocityPole) != Status::kOk)
      throw Error("monitor: the low-pass of the velocity refuses its pole");
    for (Index k = 0; k < log.time.size(); ++k) {
      const double period = k > 0 ? log.time[k] - log.time[k - 1] : 0.0;
      const JointVector<double, kN> q = log.q.row(k).transpose(), tau = log.tau.row(k).transpose();
      // Refused is what the log checks refuse before: numbers that are not finite, time that stands.
      if (position.update(q, period) == Status::kOk && torque.update(tau, period) == Status::kOk) {
        signals.q.row(k) = position.value().transpose();
        signals.qd.row(k) = position.derivative().transpose();
        signals.tau.row(k) = torque.value().transpose();
      } else if (k > 0) {
        signals.q.row(k) = signals.q.row(k - 1);
        signals.qd.row(k) = signals.qd.row(k - 1);
        signals.tau.row(k) = signals.tau.row(k - 1);
      }
    }
    return 0;
  });
}

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

/// Torque beyond the rigid bodies at zero acceleration: friction, gears, effects with their memory. Joints are rigid and
/// the torque channel on time; what that leaves out is in the residual of free motion, and so in the thresholds.
Eigen::MatrixXd friction_of(const model::Robot& robot, const Signals& signals) {
  model::Robot stiff = robot;
  stiff.elasticities.clear();
  stiff.torque_delay = 0.0;
  validate::MotionRows rows{signals.time, signals.q, signals.qd, {}, {}, {}};
  rows.qdd = Eigen::MatrixXd::Zero(signals.q.rows(), signals.q.cols());
  Eigen::MatrixXd torque = validate::Predictor(stiff, signals.time[0], {.sign_width = kSignWidth}).rows(rows);
  const model::Dynamics dynamics(stiff);
  for (Index k = 0; k < torque.rows(); ++k) {
    torque.row(k) -=
        dynamics.inverse_dynamics(signals.q.row(k), signals.qd.row(k), rows.qdd.row(k)).transpose();
  }
  return torque;
}

template <int N>
ContactThresholds<double, N> sized(const Thresholds& thresholds) {
  ContactThresholds<double, N> to;
  to.bandwidth = thresholds.bandwidth;
  to.adaptation = thresholds.adaptation;
  to.reversal_time = thresholds.reversal_time;
  for (std::size_t j = 0; j < to.joints.size(); ++j) to.joints[j] = thresholds.joints[j];
  return to;
}

double median_period(const Eigen::VectorXd& time) {
  std::vector<double> periods;
  for (Index k = 1; k < time.size(); ++k) periods.push_back(time[k] - time[k - 1]);
  return statistics::median(std::move(periods));
}

/// One sample's record into the run.
template <typename Record>
void keep(const Record& record, Index k, bool with_circumstances, Run& run) {
  run.judged[static_cast<std::size_t>(k)] = record.judged;
  run.contact[static_cast<std::size_t>(k)] = record.contact;
  run.deviation.row(k) = record.deviation.transpose();
  run.threshold.row(k) = record.threshold.transpose();
  run.offset.row(k) = record.offset.transpose();
  if (record.event != ContactEvent::kNone)
    run.events.push_back({k, static_cast<int>(record.event), record.load});
  if (!with_circumstances) return;
  for (Index j = 0; j < run.deviation.cols(); ++j) {
    const auto& now = record.circumstance[static_cast<std::size_t>(j)];
    const std::array<double, kCircumstances> values{1.0,           now.speed,    now.load,
                                                    now.load_rate, now.reversal, now.ignorance};
    for (std::size_t c = 0; c < values.size(); ++c) run.circumstance[c](k, j) = values[c];
  }
}

template <int N>
void run_sized(const model::Robot& robot, const Signals& signals, const Thresholds& thresholds,
               bool with_circumstances, Run& run) {
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;
  const Arm arm(model::to_arm_model<N>(robot));
  ContactMonitor<double, N> core;
  typename ContactMonitor<double, N>::Config config;
  config.thresholds = sized<N>(thresholds);
  config.motor_inertia = signals.motor_inertia;
  config.longest_period = std::clamp(kLongestGap * median_period(signals.time), 0.1, 1000.0);
  if (const Status status = core.configure(config); status != Status::kOk) {
    throw ModelError(fmt::format(
        "robot \"{}\": thresholds of contacts: {}; expected those that heft monitor --learn writes",
        robot.name, to_string(status)));
  }
  typename ContactMonitor<double, N>::Record record;
  LagrangianTerms<double, N> terms;
  LoadColumns<double, N> columns = LoadColumns<double, N>::Zero();
  double last = 0.0;
  for (Index k = 0; k < signals.time.size(); ++k) {
    const Vector q = signals.q.row(k).transpose(), qd = signals.qd.row(k).transpose();
    const auto trig = joint_trigonometry<Arm>(q);
    lagrangian_terms(arm, trig, q, qd, terms);
    if (core.wants_load_columns()) load_columns(arm, trig, q, columns);
    const double period = k > 0 ? signals.time[k] - last : 0.0;
    if (core.update(terms, columns, qd, signals.tau.row(k).transpose(), signals.friction.row(k).transpose(),
                    period, record) == Status::kOk) {
      last = signals.time[k];
    } else {
      ++run.refused;
    }
    keep(record, k, with_circumstances, run);
  }
}

}  // namespace

Signals signals_of(const model::Robot& robot, const data::Log& log) {
  if (log.tau.cols() != robot.num_joints()) {
    throw DataError(
        fmt::format("{}: found no torque; expected tau1..tau{}, or currents with --torque-constant", log.path,
                    robot.num_joints()));
  }
  Signals signals;
  signals.time = log.time;
  signals.q = log.q;
  signals.tau = log.tau;
  signals.qd = log.qd;
  signals.velocity_derived = log.qd.cols() != log.q.cols();
  if (signals.velocity_derived) {
    signals.qd = Eigen::MatrixXd::Zero(log.q.rows(), log.q.cols());
    derive_velocity(robot.name, log, signals);
  }
  signals.motor_inertia = motor_inertia_of(robot);
  signals.friction = friction_of(robot, signals);
  return signals;
}

Run run_core(const model::Robot& robot, const Signals& signals, const Thresholds& thresholds,
             bool with_circumstances) {
  const Index samples = signals.q.rows(), n = signals.q.cols();
  Run run;
  for (Eigen::MatrixXd* matrix : {&run.deviation, &run.threshold, &run.offset}) matrix->setZero(samples, n);
  if (with_circumstances) {
    for (Eigen::MatrixXd& matrix : run.circumstance) matrix.setZero(samples, n);
  }
  run.judged.assign(static_cast<std::size_t>(samples), 0);
  run.contact.assign(static_cast<std::size_t>(samples), 0);
  model::with_joint_count(robot.num_joints(), robot.name, [&](auto size) {
    run_sized<decltype(size)::value>(robot, signals, thresholds, with_circumstances, run);
    return 0;
  });
  return run;
}

Thresholds open_thresholds(double bandwidth, const Eigen::VectorXd& rest_speed) {
  Thresholds open;
  open.bandwidth = bandwidth;
  for (const double speed : rest_speed) {
    JointThreshold<double> joint;
    joint.constant = kOpen;
    joint.offset_limit = kOpen;
    joint.rest_speed = speed;
    open.joints.push_back(joint);
  }
  return open;
}

}  // namespace heft::monitor
