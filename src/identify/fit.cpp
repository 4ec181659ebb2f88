#include "heft/identify/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "bias_test.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/identify/sums.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/regression/recorded_rows.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/residual_statistics.hpp"
#include "instrumental.hpp"
#include "missing_motion.hpp"
#include "physical.hpp"
#include "robust.hpp"
#include "sums_checks.hpp"
#include "total_least_squares.hpp"

namespace heft::identify {

const char* to_string(Method method) {
  switch (method) {
    case Method::kOls: return "ols";
    case Method::kWls: return "wls";
    case Method::kIrls: return "irls";
    case Method::kIv: return "iv";
    case Method::kTls: return "tls";
    case Method::kPhysical: return "physical";
  }
  return "";
}

namespace {

using Logs = std::vector<const data::MotionStream*>;
using regression::WeightedFit;

/// Share of outliers that is worth a note; normal noise has 1.1 % of its rows at less than half weight.
constexpr double kNotedOutliers = 0.03;
/// A parameter counts as determined when this much of its value comes from the rows ...
constexpr double kLeastResolution = 0.9;
/// ... and its half-width is below this part of its value, or of what such a robot can have.
constexpr double kWidestInterval = 0.5;

/// What every step of a fit looks at.
struct Task {
  const FitOptions& options;
  const Logs& logs;  ///< empty: sums of logs are fitted to, and no row can be read again
  const std::vector<data::StreamSummary>& summaries;  ///< one a log
  const regression::RegressionColumns& columns;
  const regression::BaseParameters& base;
  Eigen::VectorXd prior_x;  ///< p: the robot's own parameters
  Eigen::VectorXd prior;    ///< b: base parameters of these
  const regression::RecordedRows* record{nullptr};  ///< rows of the logs; null: there are none

  int num_joints() const { return columns.num_joints(); }
  bool is(Method method) const { return options.method == method; }
  void report(double done) const {
    if (options.progress) options.progress(done);
  }
};

/// Blocks of the logs that count as independent of one another.
struct Independence {
  double length{0.0};       ///< [s]
  double edge_factor{1.0};  ///< on the covariance, for what neighbours share
};

double duration_of(const std::vector<data::StreamSummary>& logs) {
  double duration = 0.0;
  for (const data::StreamSummary& log : logs) duration += log.moving_to - log.moving_from;
  return duration;
}

void check_logs(const regression::RegressionColumns& columns, const Logs& logs) {
  if (logs.empty()) throw DataError("identify: no log given; expected at least one");
  for (const data::MotionStream* log : logs) {
    if (log->summary().num_joints != columns.num_joints()) {
      throw DataError(fmt::format("{}: {} joints; expected {}, as robot \"{}\" has", log->summary().path,
                                  log->summary().num_joints, columns.num_joints(), columns.robot().name));
    }
  }
}

void refuse_arm_at_rest(const regression::RegressionColumns& columns, const std::vector<int>& resting) {
  if (static_cast<int>(resting.size()) < columns.num_joints()) return;
  throw NotIdentifiableError(
      "no joint moves in these logs: nothing can be identified; record a motion in which every joint turns "
      "back and forth at several speeds (heft excite designs one)");
}

/// Counts samples and rows. @throws DataError, NotIdentifiableError when there are too few
void count_rows(const Task& task, const WeightedFit& fit, Fit& result) {
  const int n = task.num_joints(), b = task.base.count();
  result.rows = Eigen::VectorXi::Zero(n);
  for (int j = 0; j < n; ++j) result.rows[j] = static_cast<int>(fit.joints[static_cast<std::size_t>(j)].rows());
  for (const data::StreamSummary& log : task.summaries) result.samples += log.samples;
  if (result.samples < b) {
    throw DataError(fmt::format(
        "{}: {} samples for {} unknowns; expected at least {}, and better some seconds of motion; "
        "record a longer log",
        task.summaries.front().path, result.samples, b, b));
  }
  if (result.rows.sum() <= b || result.rows.maxCoeff() <= b / n) {
    throw NotIdentifiableError(
        fmt::format("{} rows for {} unknowns: the logs are too short, or the arm hardly moves in them; "
                    "record at least {:.0f} s of motion in which every joint turns back and forth at several "
                    "speeds",
                    result.rows.sum(), b, 10.0));
  }
}

/// Outliers get less weight; from here on the reweighted rows are the rows.
void reweight_outliers(const Task& task, WeightedFit& fit, Fit& result) {
  RobustOptions options;
  options.solve = [&](const regression::TriangularFactor& data) {
    return regression::estimate(data, task.prior, task.options.ridge_from_condition);
  };
  RobustFit robust = fit_robust(task.columns, task.base, task.logs, task.options.observation,
                                fit.solution.beta, fit.noise(), options, [&](double done) { task.report(0.4 + 0.2 * done); });
  fit = WeightedFit(std::move(robust.factors));
  fit.weights = regression::weights_of(robust.noise_std);
  fit.solve_for(task.prior, task.options.ridge_from_condition);
  result.noise_std = robust.noise_std;
  if (!robust.converged) result.notes.push_back("reweighting did not converge; the last iterate is used");
  for (int j = 0; j < task.num_joints(); ++j) {
    if (robust.downweighted_share[j] > kNotedOutliers) {
      result.notes.push_back(
          fmt::format("joint {}: {:.1f} % of the samples are outliers and get less than half weight", j + 1,
                      100.0 * robust.downweighted_share[j]));
    }
  }
}

TotalLeastSquaresOptions total_options(const Task& task) {
  TotalLeastSquaresOptions options;
  options.exact = exact_columns(task.columns, task.base);
  return options;
}

/// Puts the total least squares estimate in the place of the weighted one.
void allow_for_errors_in_columns(const Task& task, WeightedFit& fit, Fit& result) {
  const TotalLeastSquaresFit total = total_least_squares(fit.rows(), total_options(task));
  if (!total.separated) {
    result.notes.push_back(
        fmt::format("total least squares finds no generic solution: {} directions are left out; do not "
                    "trust their parameters",
                    total.left_out));
  }
  fit.solution.beta = total.beta;
}

/// How long blocks must be.
Independence independent_blocks(const Task& task, const regression::BlockFactors& factors,
                                const Eigen::VectorXd& correlation_time, const Eigen::VectorXd& noise) {
  const statistics::ResidualStatistics residual{noise, correlation_time, 0.0};
  const double length = std::max(residual.block_length(duration_of(task.summaries)), factors.block_length());
  return {length, residual.edge_factor(length)};
}

/// Estimate and covariance from the rows as they are.
void put_estimate(const Task& task, const WeightedFit& fit, const Independence& blocks, Fit& result) {
  result.beta = fit.solution.beta;
  // Blocks of whole logs are as long as these are.
  result.block_length = fit.factors.partition().has_whole_logs()
                            ? duration_of(task.summaries) / fit.factors.num_blocks()
                            : blocks.length;
  if (task.is(Method::kTls)) {
    // The gradient of least squares does not vanish there: it has a spread of its own.
    TotalLeastSquaresSpread spread =
        total_least_squares(fit.factors, fit.weights, total_options(task), blocks.length, blocks.edge_factor);
    result.covariance = std::move(spread.covariance);
    result.blocks = spread.groups;
  } else {
    regression::Spread spread =
        regression::spread_of(fit.factors, fit.weights, fit.solution, blocks.length, blocks.edge_factor);
    result.covariance = std::move(spread.covariance);
    result.blocks = spread.blocks;
  }
}

/// Instruments: the estimate itself with kIv, else a test whether least squares needs them.
void use_instruments(const Task& task, const WeightedFit& weighted, const Independence& blocks, Fit& result) {
  const Eigen::VectorXd& start = weighted.solution.beta;
  const bool to_fit = task.is(Method::kIv);
  InstrumentOptions options;
  options.kind = task.options.instruments;
  if (options.kind == Instruments::kReference) options.reference = task.options.reference;
  if (!to_fit) options.max_iterations = 1;
  const InstrumentalFit fit =
      fit_instrumental(task.columns, task.base, task.logs, task.options.observation, start, result.noise_std,
                       options, [&](double done) { task.report(0.7 + 0.25 * done); }, task.record, &weighted.factors);
  const Eigen::VectorXd weights = regression::weights_of(result.noise_std);
  result.bias =
      test_bias(fit.sums, weights, start, options.condition_limit, blocks.length, blocks.edge_factor);
  if (!to_fit) return;
  const InstrumentalEstimate estimate = solve_instrumental(fit.sums, weights, start, options.condition_limit,
                                                           blocks.length, blocks.edge_factor);
  result.beta = estimate.beta;
  result.covariance = estimate.covariance;
  result.blocks = estimate.groups;
  result.noise_std = fit.noise_std;
  result.notes.insert(result.notes.end(), fit.notes.begin(), fit.notes.end());
  if (!fit.converged && options.kind != Instruments::kDelayed) {
    result.notes.push_back("the instruments did not converge; the last iterate is used");
  }
}

/// Intervals of the estimate, and how well conditioned its rows are.
void put_intervals(const Task& task, const WeightedFit& fit, Fit& result) {
  result.std = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  result.half_width = statistics::interval_factor(result.blocks - 1) * result.std;
  result.condition = fit.solution.condition;
  result.ridge = fit.solution.ridge > 0.0;
  const Eigen::VectorXd raw = singular_values(fit.rows().R());
  result.condition_unscaled =
      raw[raw.size() - 1] > 0.0 ? raw[0] / raw[raw.size() - 1] : std::numeric_limits<double>::infinity();
  const double cutoff = task.options.observation.cutoff;
  result.cutoff = cutoff > 0.0 ? cutoff : task.summaries.front().cutoff;
}

/// p: a size that each parameter can be expected to have on this robot, against which "undetermined" is measured.
Eigen::VectorXd expected_sizes(const regression::RegressionColumns& columns,
                               const std::vector<data::StreamSummary>& logs) {
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(columns.num_joints());
  for (const data::StreamSummary& log : logs) torque = torque.cwiseMax(log.max_torque);
  const model::Robot& robot = columns.robot();
  const auto n = static_cast<std::size_t>(columns.num_joints());
  // Mass beyond each joint and reach from link to link.
  std::vector<double> reach(n, 0.0), mass(n, 0.0);
  for (std::size_t j = 0; j < n; ++j) {
    mass[j] = std::max(robot.joints[j].link[kMass], 0.1);
    const auto& next = j + 1 < n ? robot.joints[j + 1].joint.position : robot.tip_position;
    reach[j] = std::max(0.05, std::sqrt(next[0] * next[0] + next[1] * next[1] + next[2] * next[2]));
  }
  Eigen::VectorXd size(columns.count());
  for (int i = 0; i < columns.count(); ++i) {
    const regression::Column& column = columns[i];
    const auto j = static_cast<std::size_t>(column.joint);
    switch (column.kind) {
      case regression::ColumnKind::kLink:
        size[i] = column.entry == kMass  ? mass[j]
                  : column.entry <= kMcz ? mass[j] * reach[j]
                                         : mass[j] * reach[j] * reach[j];
        break;
      case regression::ColumnKind::kRotorInertia:
      case regression::ColumnKind::kCouplingInertia: size[i] = mass[j] * reach[j] * reach[j]; break;
      default: size[i] = 0.1 * std::max(torque[column.joint], 1e-3); break;
    }
  }
  return size;
}

/// The parameters nearest to `x` with G x = β exactly, distance measured in expected sizes.
Eigen::VectorXd with_base(const regression::BaseParameters& base, const Eigen::VectorXd& x,
                          const Eigen::VectorXd& beta, const Eigen::VectorXd& size) {
  // G is [I, D] up to order: always of full row rank.
  const Eigen::MatrixXd scaled = base.regrouping * size.asDiagonal();
  const Eigen::VectorXd step =
      scaled.transpose() * solve_symmetric(scaled * scaled.transpose(), beta - base.regrouping * x);
  Eigen::VectorXd moved = x + size.cwiseProduct(step);
  // One refinement: the step above is exact to rounding of the scaled system only. The kept columns are the
  // identity, so what is left goes there.
  const Eigen::VectorXd left = beta - base.regrouping * moved;
  for (int k = 0; k < base.count(); ++k) moved[base.kept[static_cast<std::size_t>(k)]] += left[k];
  return moved;
}

/// Link parameters that give β, and what it costs that they are physically possible.
/// @param size  p: expected sizes
void put_link_parameters(const Task& task, const WeightedFit& fit, const Eigen::VectorXd& size, Fit& result) {
  if (!task.options.link_parameters && !task.is(Method::kPhysical)) return;
  const PhysicalFit physical =
      fit_physical(task.columns, task.base,
                   regression::weighted(fit.joints, regression::weights_of(result.noise_std)), task.prior_x);
  result.repaired_prior = physical.repaired_prior;
  result.at_boundary = physical.at_boundary;
  result.physical_cost_ratio = physical.unconstrained_squared_error > 0.0
                                   ? physical.squared_error / physical.unconstrained_squared_error
                                   : 1.0;
  if (task.is(Method::kPhysical)) {
    result.beta = physical.beta;
    task.columns.apply(physical.x, result.robot);
  } else {
    // From the physical set the least step to these β; it stays physical where β allow it.
    task.columns.apply(with_base(task.base, physical.x, result.beta, size), result.robot);
  }
  result.physically_consistent = model::is_physically_consistent(result.robot);
}

/// Which parameters the logs determine: their value comes from the rows, and their interval is narrow.
void find_determined(const Task& task, const Eigen::VectorXd& resolution, const Eigen::VectorXd& size,
                     Fit& result) {
  result.relative = result.half_width.cwiseQuotient(result.beta.cwiseAbs().cwiseMax(1e-300));
  for (int i = 0; i < task.base.count(); ++i) {
    const double against =
        std::max(std::abs(result.beta[i]), size[task.base.kept[static_cast<std::size_t>(i)]]);
    result.determined.push_back(resolution[i] > kLeastResolution &&
                                result.half_width[i] < kWidestInterval * against);
  }
}

/// A fit before it has seen a row: columns, base parameters, what the robot says of them.
Fit begin(const model::Robot& robot, const FitOptions& options, const regression::ModelStructure& structure) {
  Fit result;
  result.method = options.method;
  result.robot = robot;
  result.columns = std::make_shared<const regression::RegressionColumns>(robot, structure);
  return result;
}

/// The fit of rows that were read once. `correlation` gives the correlation time of the residual [s], n.
void solve(const Task& task, regression::BlockFactors factors,
           const std::function<Eigen::VectorXd(const Eigen::VectorXd& beta)>& correlation, Fit& result) {
  WeightedFit weighted(std::move(factors));
  task.report(0.35);
  count_rows(task, weighted, result);
  regression::weigh_joints(task.prior, task.options.ridge_from_condition, !task.is(Method::kOls), weighted);
  task.report(0.4);
  if (task.is(Method::kIrls)) reweight_outliers(task, weighted, result);
  if (task.is(Method::kTls)) allow_for_errors_in_columns(task, weighted, result);
  if (!task.is(Method::kIrls)) result.noise_std = weighted.noise();

  const Independence blocks =
      independent_blocks(task, weighted.factors, correlation(weighted.solution.beta), result.noise_std);
  task.report(0.7);
  put_estimate(task, weighted, blocks, result);
  const bool may_be_biased = task.is(Method::kWls) || task.is(Method::kOls);
  if (task.is(Method::kIv) || (may_be_biased && task.options.test_bias && !task.logs.empty()))
    use_instruments(task, weighted, blocks, result);
  put_intervals(task, weighted, result);

  const Eigen::VectorXd size = expected_sizes(task.columns, task.summaries);
  put_link_parameters(task, weighted, size, result);
  find_determined(task, weighted.solution.resolution, size, result);
  result.missing = missing_motion(result, resting_joints(task.columns, task.summaries));
  task.report(1.0);
}

/// Rows-weighted mean over the logs of the correlation times of their own fits, n [s].
Eigen::VectorXd mean_correlation(const Sums& sums) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(sums.factors.num_joints());
  double samples = 0.0;
  for (const LogShare& log : sums.logs) {
    sum += static_cast<double>(log.summary.samples) * log.correlation_time;
    samples += static_cast<double>(log.summary.samples);
  }
  return sum / samples;
}

}  // namespace

Fit fit(const model::Robot& robot, const Logs& logs, const FitOptions& options) {
  Fit result = begin(robot, options, options.structure);
  const regression::RegressionColumns& columns = *result.columns;
  check_logs(columns, logs);
  std::vector<data::StreamSummary> summaries;
  for (const data::MotionStream* log : logs) summaries.push_back(log->summary());
  refuse_arm_at_rest(columns, resting_joints(columns, summaries));
  result.base = regression::find_base_parameters(columns);
  const Eigen::VectorXd prior = columns.values(robot);
  regression::RecordedRows record;
  Task task{options, logs, summaries, columns, result.base, prior, result.base.regrouping * prior};
  task.record = &record;
  solve(
      task, regression::compressed(columns, task.base, logs, options.observation, {}, &record),
      [&](const Eigen::VectorXd& beta) {
        return regression::residual_correlation(columns, task.base, logs, options.observation, beta, record);
      },
      result);
  return result;
}

Fit fit(const model::Robot& robot, const Sums& sums, const FitOptions& options) {
  refuse_other_robot(robot, sums);
  if (options.method == Method::kIrls || options.method == Method::kIv) {
    throw InputError(fmt::format(
        "method {}: reads the rows of the logs several times, sums hold none; expected ols, wls, tls or physical; "
        "or fit to the logs themselves",
        to_string(options.method)));
  }
  Fit result = begin(robot, options, sums.structure);
  const regression::RegressionColumns& columns = *result.columns;
  std::vector<data::StreamSummary> summaries;
  for (const LogShare& log : sums.logs) summaries.push_back(log.summary);
  refuse_arm_at_rest(columns, resting_joints(columns, summaries));
  result.base = regression::find_base_parameters(columns);
  if (result.base.count() != sums.factors.num_columns()) {
    throw DataError(
        fmt::format("sums: hold {} base parameters; expected {}, as robot \"{}\" has; make them again "
                    "with this version of heft",
                    sums.factors.num_columns(), result.base.count(), robot.name));
  }
  const Eigen::VectorXd prior = columns.values(robot);
  FitOptions as_summed = options;
  as_summed.observation = sums.observation;
  const Logs none;
  const Task task{as_summed, none, summaries, columns, result.base, prior, result.base.regrouping * prior};
  solve(
      task, sums.factors, [&](const Eigen::VectorXd&) { return mean_correlation(sums); }, result);
  return result;
}

}  // namespace heft::identify
