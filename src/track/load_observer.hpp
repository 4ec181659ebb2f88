/// @file
/// Core's load observer for a robot of the simulator, and its estimate over time.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/status.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/robot.hpp"
#include "heft/model/run_time_arm.hpp"
#include "heft/sim/controller.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/track/controllers.hpp"
#include "model_feed_forward.hpp"

namespace heft::track {

/// What the simulator measures, into core's observer; what it finds, into a trace.
template <int N>
class LoadObserver {
 public:
  using Core = heft::LoadObserver<model::ModelOf<N>, double>;
  using Estimator = typename Core::Estimator;

  /// @param nominal  the arm without load
  /// @param trace    gets the estimate over time; may be null
  /// @throws ModelError for settings outside their ranges
  LoadObserver(const model::Robot& nominal, const ControllerSettings& settings,
               std::shared_ptr<LoadTrace> trace)
      : trace_(std::move(trace)) {
    typename Core::Config config;
    config.first_row = settings.rows - 1;
    config.filter_hz = settings.filter_hz;
    config.update_rate = settings.update_rate;
    config.mass_prior = settings.mass_prior;
    if (settings.noise.size() == N) config.noise_std = settings.noise;
    config.sign_width = kSignWidth;
    config.transition_time = 0.0;
    if (core_.configure(model::to_arm_model<N>(nominal), config) != Status::kOk) {
      throw ModelError(
          fmt::format("tracking: estimator settings k = {}, filter {} Hz, mass prior {} kg: expected k from "
                      "1 to {} and positive values",
                      settings.rows, settings.filter_hz, settings.mass_prior, N));
    }
    model::add_parts(nominal, core_);
  }

  /// The load that the model is to carry, in the last link frame.
  const InertialParameters<double>& load() const { return core_.load(); }
  /// The estimate and the variance of parameter i, see PayloadEstimator.
  const Estimator& estimator() const { return core_.estimator(); }

  /// Takes a sample.
  /// @return kNonFiniteInput, kOutOfRange: the sample is refused and leaves no trace
  Status sample(const sim::Measurement& m) {
    typename Core::Record record;
    const Status status = core_.update(m.q, m.qd, m.tau, m.sample_time, record);
    if (trace_ && record.changed) trace_->change.push_back(m.time);
    if (trace_ && record.due) note(m.time, record.settling);
    return status;
  }

 private:
  void note(double time, bool unclear) {
    const InertialParameters<double> load = core_.estimator().payload();
    const double wide = statistics::kNormal95 * core_.widening();
    const double half = unclear ? kNaN : wide * core_.estimator().standard_deviation(0);
    trace_->time.push_back(time);
    trace_->mass.push_back(unclear ? kNaN : load[kMass]);
    trace_->mass_half_width.push_back(half);
    std::array<double, 3> com{kNaN, kNaN, kNaN}, com_half{kNaN, kNaN, kNaN};
    if (std::abs(load[kMass]) > 3 * half) {
      for (std::size_t a = 0; a < 3; ++a) {
        com[a] = load[kMcx + a] / load[kMass];
        typename Estimator::Row row{};
        row[kMass] = -com[a] / load[kMass];
        row[kMcx + a] = 1 / load[kMass];
        com_half[a] = wide * std::sqrt(core_.estimator().estimator().variance(row));
      }
    }
    trace_->com.push_back(com);
    trace_->com_half_width.push_back(com_half);
  }

  Core core_;
  std::shared_ptr<LoadTrace> trace_;
};

}  // namespace heft::track
