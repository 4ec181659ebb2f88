#include "causal_run.hpp"

#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/statistics/median.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// Positions, velocities and torque behind the low-pass.
void derive_velocity(const model::Robot& robot, const data::Log& log, Signals& signals) {
  SampleFilter filter(robot);
  Eigen::VectorXd q, qd, tau;
  for (Index k = 0; k < log.time.size(); ++k) {
    q = log.q.row(k);
    tau = log.tau.row(k);
    filter.update(q, qd, tau, k > 0 ? log.time[k] - log.time[k - 1] : 0.0);
    signals.q.row(k) = q.transpose();
    signals.qd.row(k) = qd.transpose();
    signals.tau.row(k) = tau.transpose();
  }
}

/// One sample's record into the run.
void keep(const SampleRecord& record, Index k, Run& run) {
  run.judged[static_cast<std::size_t>(k)] = record.judged;
  run.contact[static_cast<std::size_t>(k)] = record.contact;
  run.deviation.row(k) = record.deviation.transpose();
  run.threshold.row(k) = record.threshold.transpose();
  run.residual.row(k) = record.residual.transpose();
  run.level_threshold.row(k) = record.level_threshold.transpose();
  run.change.row(k) = record.change.transpose();
  run.change_threshold.row(k) = record.change_threshold.transpose();
  if (record.event != ContactEvent::kNone)
    run.events.push_back({k, static_cast<int>(record.event), record.load});
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
    derive_velocity(robot, log, signals);
  }
  signals.friction = SampleFriction(robot, signals.time[0]).rows(signals.time, signals.q, signals.qd);
  return signals;
}

Run run_core(const model::Robot& robot, const Signals& signals, const Thresholds& thresholds) {
  const Index samples = signals.q.rows(), n = signals.q.cols();
  Run run;
  for (Eigen::MatrixXd* matrix : {&run.deviation, &run.threshold, &run.residual, &run.level_threshold,
                                  &run.change, &run.change_threshold})
    matrix->setZero(samples, n);
  run.judged.assign(static_cast<std::size_t>(samples), 0);
  run.contact.assign(static_cast<std::size_t>(samples), 0);
  SampleMonitor core(robot, thresholds, median_period(signals.time));
  SampleRecord record;
  double last = 0.0;
  for (Index k = 0; k < samples; ++k) {
    const double period = k > 0 ? signals.time[k] - last : 0.0;
    if (core.update(signals.q.row(k), signals.qd.row(k), signals.tau.row(k), signals.friction.row(k), period,
                    record) == Status::kOk) {
      last = signals.time[k];
    } else {
      ++run.refused;
    }
    keep(record, k, run);
  }
  return run;
}

double median_period(const Eigen::VectorXd& time) {
  std::vector<double> periods;
  for (Index k = 1; k < time.size(); ++k) periods.push_back(time[k] - time[k - 1]);
  return statistics::median(std::move(periods));
}

}  // namespace heft::monitor
