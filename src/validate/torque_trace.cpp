#include "heft/validate/torque_trace.hpp"

#include <algorithm>

#include "heft/host/numbers.hpp"

namespace heft::validate {
namespace {

/// Steps of a trace: about as many as a plot has pixels.
constexpr long kTraceSteps = 1500;

void widen(TorqueTrace::Extremes& extremes, double value) {
  extremes.low = std::min(extremes.low, value);
  extremes.high = std::max(extremes.high, value);
}

}  // namespace

TorqueTrace::TorqueTrace(long samples, Eigen::Index joints)
    : rows_a_step_(std::max(1L, (samples + kTraceSteps - 1) / kTraceSteps)), joints_(joints) {}

void TorqueTrace::add(const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                      const Eigen::MatrixXd& predicted) {
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    const long row = rows_++ % rows_a_step_;  // within its step
    if (row == 0) {
      time_.push_back(time[k]);
      const Extremes none{kInfinity, -kInfinity};
      steps_.emplace_back(static_cast<std::size_t>(joints_), Step{none, none, none, 0.0});
    }
    for (Eigen::Index j = 0; j < joints_; ++j) {
      Step& step = steps_.back()[static_cast<std::size_t>(j)];
      widen(step.measured, measured(k, j));
      widen(step.predicted, predicted(k, j));
      const double residual = measured(k, j) - predicted(k, j);
      widen(step.residual, residual);
      step.residual_mean += (residual - step.residual_mean) / static_cast<double>(row + 1);
    }
  }
}

}  // namespace heft::validate
