#include "instrumental.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/regression/weighted_fit.hpp"
#include "heft/statistics/jackknife.hpp"
#include "instrument_comparison.hpp"

namespace heft::identify {
namespace {

/// Smallest first-stage t-ratio of strong instruments: the usual F > 10, and some more since it is the least
/// of many.
constexpr double kWeakRatio = 4.0;

/// What a reader must know of the instruments of a fit.
std::vector<std::string> notes_on(const InstrumentalEstimate& estimate, const SimulationReport& report) {
  std::vector<std::string> notes;
  if (estimate.relevance_ratio < kWeakRatio) {
    notes.push_back(fmt::format(
        "instruments are weak: in one direction they show {:.1f} % of the motion, {:.1f} times "
        "the scatter of that figure (expected above {:.0f}); the estimate and its interval cannot be "
        "trusted there: record more, or use other instruments",
        100.0 * estimate.relevance, estimate.relevance_ratio, kWeakRatio));
  }
  if (report.failed > 0) {
    notes.push_back(fmt::format(
        "{} of {} pieces of log could not be simulated (the fitted mass matrix is not positive "
        "definite there); their instruments are the smoothed motion itself, which serves nearly as "
        "well",
        report.failed.load(), report.pieces.load()));
  }
  return notes;
}

}  // namespace

InstrumentalEstimate solve_instrumental(const InstrumentSums& sums, const Eigen::VectorXd& weights,
                                        const Eigen::VectorXd& start, double condition_limit, double length,
                                        double edge_factor) {
  const Comparison c = compare(sums, weights, start, condition_limit, length, false);
  InstrumentalEstimate estimate;
  estimate.beta = start + c.frame.T * c.u;
  estimate.covariance =
      c.frame.T * statistics::jackknife_covariance(c.without, edge_factor) * c.frame.T.transpose();
  estimate.groups = static_cast<int>(c.without.cols());
  estimate.left_out = c.frame.left_out;
  estimate.relevance = c.relevance;
  estimate.relevance_ratio = c.relevance_ratio;
  return estimate;
}

InstrumentalFit fit_instrumental(const regression::RegressionColumns& columns,
                                 const regression::BaseParameters& base,
                                 const std::vector<const data::MotionStream*>& logs,
                                 const regression::ObservationOptions& observation,
                                 const Eigen::VectorXd& start_beta, const Eigen::VectorXd& start_noise,
                                 const InstrumentOptions& options,
                                 const std::function<void(double)>& progress,
                                 const regression::RecordedRows* recorded, const regression::BlockFactors* plain) {
  if (start_beta.size() != base.count() || start_noise.size() != columns.num_joints()) {
    throw DataError(
        fmt::format("instruments: a start of {} parameters and {} noise levels; expected {} and {}",
                    start_beta.size(), start_noise.size(), base.count(), columns.num_joints()));
  }
  const Eigen::VectorXd weights = regression::weights_of(start_noise);
  const bool simulated = options.kind != Instruments::kDelayed;
  const int limit = simulated ? std::max(1, options.max_iterations) : 1;
  const auto fresh = [&] {
    if (plain != nullptr) return InstrumentSums(*plain);
    return InstrumentSums(columns.num_joints(), base.count(), options.block, options.max_blocks);
  };
  InstrumentalFit fit{{}, fresh(), start_noise, 0, false, {}};
  Eigen::VectorXd beta = start_beta;
  auto report = std::make_shared<SimulationReport>();
  while (fit.iterations < limit && !fit.converged) {
    report->pieces = report->failed = 0;
    const regression::InstrumentMotion motion =
        simulated ? simulated_motion(columns, base, beta, logs, options, report)
                  : delayed_motion(logs, observation, options);
    fit.sums = fresh();
    regression::for_each_observation(
        columns, base.kept, logs, observation,
        [&](const regression::ObservationRows& rows) {
          fit.sums.add(rows.log, rows.joint, rows.time, rows.Z, rows.W, rows.tau);
        },
        motion, recorded);
    fit.estimate = solve_instrumental(fit.sums, weights, start_beta, options.condition_limit);
    const regression::TriangularFactor data = fit.sums.plain().weighted(weights);
    const double moved = (data.R() * (fit.estimate.beta - beta)).norm() /
                         std::sqrt(std::max(1.0, static_cast<double>(data.rows())));
    beta = fit.estimate.beta;
    ++fit.iterations;
    fit.converged = !simulated || moved < options.tolerance;
    if (progress) progress(static_cast<double>(fit.iterations) / limit);
  }
  if (progress) progress(1.0);

  const std::vector<regression::TriangularFactor> joints = fit.sums.plain().joints();
  for (int j = 0; j < columns.num_joints(); ++j) {
    const regression::TriangularFactor& joint = joints[static_cast<std::size_t>(j)];
    if (joint.rows() > 0)
      fit.noise_std[j] = std::sqrt(joint.squared_error(beta) / static_cast<double>(joint.rows()));
  }
  fit.notes = notes_on(fit.estimate, *report);
  return fit;
}

}  // namespace heft::identify
