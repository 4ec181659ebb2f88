#include "heft/identify/moving_horizon.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/core/numeric_range.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/physical_links.hpp"
#include "horizon_rows.hpp"
#include "horizon_window.hpp"
#include "physical_problem.hpp"
#include "physical_search.hpp"

namespace heft::identify {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using regression::ColumnKind;
using regression::TriangularFactor;

namespace {

/// Least distance of a link from the edge of what is possible, in parts of its prior.
constexpr double kMargin = 1e-6;
/// What a step may leave to gain, of −2 log-likelihood, in parts of the prior's weight: far below one standard deviation.
constexpr double kTolerance = 1e-4;
/// Steps before the arm's noise is known, each with its own scale.
constexpr int kFirstRounds = 6;
/// Share of a step's scatter in the running one: half of it is new after seven steps.
constexpr double kNoiseShare = 0.1;
/// Weight of the divergence, which keeps links and friction possible: 0.01 costs a body ten times as heavy as its prior
/// less than a standard deviation.
constexpr double kBarrier = 0.01;
/// Share of the prior's standard deviation that the samples must leave for a parameter to count as determined.
constexpr double kDetermined = 0.5;

void check(double value, double low, double high, const char* name, const char* unit) {
  if (value >= low && value <= high) return;
  throw ModelError(fmt::format("moving horizon: {} is {:g}{}; expected {:g} to {:g}{}", name, value, unit,
                               low, high, unit));
}

void check_options(const model::Robot& robot, const HorizonOptions& options) {
  check(options.window, 0.5, 60.0, "the window", " s");
  check(options.period, 0.01, 0.5 * options.window, "the period of steps", " s");
  check(options.cutoff, 0.1, 1000.0, "the cut-off", " Hz");
  check(options.row_rate, 0.1, 1000.0, "the rate of rows", " Hz");
  check(options.rest_speed, 0.0, 1e6, "the speed of rest", " rad/s");
  check(options.friction_drift, 1e-6, 1e6, "the drift of friction", "");
  check(options.link_drift, 0.0, 1e6, "the drift of links", "");
  check(options.friction_spread, 1e-6, 1e6, "the spread of friction", "");
  check(options.link_spread, 1e-6, 1e6, "the spread of links", "");
  check(options.degrees_of_freedom, 1.0, 1e6, "the number of degrees of freedom", "");
  check(options.reweightings, 1, 100, "the number of reweightings", "");
  check(options.max_iterations, 1, 10000, "the number of iterations", "");
  for (const int link : options.links) {
    if (link < 0 || link >= robot.num_joints()) {
      throw ModelError(
          fmt::format("moving horizon: link {}; expected links from 0 to {}", link, robot.num_joints() - 1));
    }
  }
  if (!robot.effects.empty() || !robot.cables.empty() || !robot.elasticities.empty() || robot.torque_delay != 0.0) {
    throw ModelError(
        "moving horizon: the robot has effects, elastic joints or a torque delay; expected rigid bodies, rotors, "
        "friction and gear couplings; take the effects out of the model (model::without_effects)");
  }
}

std::shared_ptr<const regression::RegressionColumns> columns_of(const model::Robot& robot) {
  regression::ModelStructure all;
  all.couplings = robot.couplings;
  return std::make_shared<const regression::RegressionColumns>(robot, all);
}

std::vector<int> unknown_columns(const regression::RegressionColumns& columns,
                                 const HorizonOptions& options) {
  std::vector<int> links = options.links;
  if (links.empty()) links.push_back(columns.num_joints() - 1);
  std::vector<int> unknown;
  for (int k = 0; k < columns.count(); ++k) {
    const regression::Column& column = columns[k];
    const bool wanted = (column.kind == ColumnKind::kLink &&
                         std::find(links.begin(), links.end(), column.joint) != links.end()) ||
                        (column.kind == ColumnKind::kCoulomb && options.coulomb) ||
                        (column.kind == ColumnKind::kViscous && options.viscous) ||
                        (column.kind == ColumnKind::kOffset && options.offset);
    if (wanted) unknown.push_back(k);
  }
  return unknown;
}

}  // namespace

const char* to_string(HorizonStatus status) {
  switch (status) {
    case HorizonStatus::kCollected: return "collected";
    case HorizonStatus::kFilling: return "filling the window";
    case HorizonStatus::kUpdated: return "updated";
    case HorizonStatus::kNotExcited: return "not excited";
    case HorizonStatus::kNotFinite: return "not finite";
    case HorizonStatus::kTimeNotIncreasing: return "time not increasing";
  }
  return "";
}

const std::string& HorizonEstimate::name(int i) const {
  return (*columns)[unknown[static_cast<std::size_t>(i)]].name;
}

const std::string& HorizonEstimate::unit(int i) const {
  return (*columns)[unknown[static_cast<std::size_t>(i)]].unit;
}

double HorizonEstimate::value(int i) const { return values[unknown[static_cast<std::size_t>(i)]]; }

statistics::Interval HorizonEstimate::interval(int i) const {
  return statistics::Interval::around(value(i), std[i]);
}

bool HorizonEstimate::usable() const {
  return !std::isnan(time) && std::find(determined.begin(), determined.end(), true) != determined.end();
}

model::Robot HorizonEstimate::robot() const {
  model::Robot robot = columns->robot();
  columns->apply(values, robot);
  return robot;
}

model::ModelFile HorizonEstimate::model_file() const {
  model::ModelFile file = model::make_model(robot());
  file.provenance.method = "moving-horizon";
  // The columns of links, rotors and friction are the model file's, in its order; couplings follow, none of them unknown.
  VectorXd deviations = VectorXd::Constant(14 * Index{columns->num_joints()}, kNaN);
  for (std::size_t i = 0; i < unknown.size(); ++i) {
    if (determined[i]) deviations[unknown[i]] = std[static_cast<Index>(i)];
  }
  file.standard_deviations = deviations;
  return file;
}

struct MovingHorizon::Impl {
  Impl(const model::Robot& robot, const HorizonOptions& settings)
      : options(settings),
        columns(columns_of(robot)),
        unknown(unknown_columns(*columns, settings)),
        rows(columns, unknown, settings),
        window(columns->num_joints()),
        arrival(static_cast<int>(unknown.size())) {
    const auto u = static_cast<Index>(unknown.size());
    estimate.columns = columns;
    estimate.unknown = unknown;
    estimate.values = columns->values(robot);
    estimate.std = VectorXd::Constant(u, kNaN);
    estimate.determined.assign(unknown.size(), false);
    estimate.excited.assign(unknown.size(), false);
    estimate.noise_std = VectorXd::Zero(columns->num_joints());
    estimate.smallest_eigenvalue = smallest_eigenvalue();
  }

  HorizonStatus step(double now);
  bool begin();
  void solve(int rounds, double noise_share);
  void widen_arrival(double time);
  VectorXd of_blocks(double link, double number) const;
  VectorXd walk(double seconds) const;
  TriangularFactor prior() const;
  MatrixXd covariance(const TriangularFactor& factor) const;
  std::vector<bool> excited() const;
  std::vector<bool> narrow(const MatrixXd& covariance) const;
  void put_values();
  double smallest_eigenvalue() const;
  void put_spread();

  HorizonOptions options;
  std::shared_ptr<const regression::RegressionColumns> columns;
  std::vector<int> unknown;
  HorizonRows rows;
  HorizonWindow window;
  TriangularFactor arrival;                ///< of everything before the window
  double arrival_time{kNaN};               ///< to which it is widened [s]
  double weight;                           ///< of the prior: 2 / spread²
  std::optional<PhysicalProblem> problem;  ///< in units of the prior; none before the first full window
  PhysicalState state;
  double first{kNaN}, last_step{kNaN};  ///< [s]
  HorizonEstimate estimate;
};

/// u: one number for the entries of links, another for friction.
VectorXd MovingHorizon::Impl::of_blocks(double link, double number) const {
  VectorXd values(problem->x0.size());
  for (const PhysicalBlock& block : problem->blocks)
    values.segment(block.first, block.size).setConstant(block.kind == Unknown::kLink ? link : number);
  return values;
}

/// Standard deviations of a walk over some time, in units of the prior.
VectorXd MovingHorizon::Impl::walk(double seconds) const {
  const double minutes = std::sqrt(seconds / 60.0);
  return of_blocks(minutes * options.link_drift, minutes * options.friction_drift);
}

/// The robot's own parameters as rows, in units of themselves.
TriangularFactor MovingHorizon::Impl::prior() const {
  const VectorXd inverse = of_blocks(options.link_spread, options.friction_spread).cwiseInverse();
  TriangularFactor factor(static_cast<int>(inverse.size()));
  factor.add(inverse.asDiagonal().toDenseMatrix(), inverse.cwiseProduct(to_s(*problem, at_prior(*problem))));
  return factor;
}

/// Takes the first full window to set the units: what is known of friction may be 0.
bool MovingHorizon::Impl::begin() {
  const int p = columns->count(), u = static_cast<int>(unknown.size());
  if (window.rows() < 2 * u) return false;
  window.guess_noise();
  const TriangularFactor rows_of_unknown = window.factor(u);
  MatrixXd scattered = MatrixXd::Zero(u, p);
  scattered(Eigen::all, unknown) = rows_of_unknown.R();
  TriangularFactor data(p);
  data.add(scattered, rows_of_unknown.z());
  regression::BaseParameters each;
  each.regrouping = MatrixXd::Identity(p, p);
  PriorChanges changes;
  problem = part_of(make_problem(*columns, each, data, estimate.values, kMargin, changes), unknown);
  window.transform(problem->T, problem->x0);
  state = at_prior(*problem);
  arrival = prior();
  return true;
}

void MovingHorizon::Impl::widen_arrival(double time) {
  if (time > arrival_time) arrival = widened(arrival, walk(time - arrival_time));
  if (!(time <= arrival_time)) arrival_time = time;
}

/// Weights, then the solver, some times over; each begins where the last one ended.
void MovingHorizon::Impl::solve(int rounds, double noise_share) {
  estimate.iterations = 0;
  for (int round = 0; round < rounds; ++round) {
    estimate.outliers = window.weigh(to_s(*problem, state), options.degrees_of_freedom);
    TriangularFactor all = window.factor(static_cast<int>(unknown.size()));
    all.add(arrival);
    problem->A = all.R();
    problem->z = all.z();
    int iterations = 0;
    estimate.converged =
        solve_stage(*problem, kBarrier, kTolerance, options.max_iterations, state, iterations);
    estimate.iterations += iterations;
    if (noise_share > 0.0) window.learn_noise(to_s(*problem, state), noise_share);
  }
}

HorizonStatus MovingHorizon::Impl::step(double now) {
  const bool begins = !problem;
  if (begins && (now - first < options.window || !begin()))
    return now - first < options.window ? HorizonStatus::kFilling : HorizonStatus::kNotExcited;
  widen_arrival(now - options.window);
  window.move_older(now - options.window, arrival);

  // Noise is learnt in any case: judged by too much of it, no window would excite.
  if (begins) {
    solve(kFirstRounds, 1.0);
  } else {
    window.learn_noise(to_s(*problem, state), kNoiseShare);
  }
  estimate.excited = excited();
  const bool updates =
      std::find(estimate.excited.begin(), estimate.excited.end(), true) != estimate.excited.end();
  if (updates) {
    if (!begins) solve(options.reweightings, 0.0);
    put_values();
  }
  estimate.time = now;
  put_spread();
  return updates ? HorizonStatus::kUpdated : HorizonStatus::kNotExcited;
}

/// What the window tells by itself, next to the prior.
std::vector<bool> MovingHorizon::Impl::excited() const {
  const int u = static_cast<int>(unknown.size());
  if (window.rows() < u) return std::vector<bool>(unknown.size(), false);
  TriangularFactor alone = window.factor(u);
  alone.add(prior());
  return narrow(covariance(alone));
}

/// In units of the prior. The curvature of the divergence is left out: at the edge of what is possible it is high, and an
/// interval by it would exclude the edge.
MatrixXd MovingHorizon::Impl::covariance(const TriangularFactor& factor) const {
  const Index u = problem->x0.size();
  return solve_symmetric(factor.information(), MatrixXd::Identity(u, u));
}

/// Parameters of which the samples know more than the prior.
std::vector<bool> MovingHorizon::Impl::narrow(const MatrixXd& covariance) const {
  const VectorXd spread = of_blocks(options.link_spread, options.friction_spread);
  const MatrixXd& T = problem->T;
  const VectorXd before = (T * spread.cwiseAbs2().asDiagonal() * T.transpose()).diagonal();
  const VectorXd after = (T * covariance * T.transpose()).diagonal();
  std::vector<bool> narrow;
  for (Index i = 0; i < after.size(); ++i) narrow.push_back(after[i] < kDetermined * kDetermined * before[i]);
  return narrow;
}

void MovingHorizon::Impl::put_values() {
  estimate.values(unknown) = problem->x0 + problem->T * to_s(*problem, state);
  estimate.smallest_eigenvalue = smallest_eigenvalue();
}

/// Of the pseudo-inertias of the links that are estimated.
double MovingHorizon::Impl::smallest_eigenvalue() const {
  double smallest = kInfinity;
  for (const int k : unknown) {
    if ((*columns)[k].kind != ColumnKind::kLink || (*columns)[k].entry != kMass) continue;
    InertialParameters<double> link{};
    std::copy_n(estimate.values.data() + k, link.size(), link.begin());
    smallest = std::min(smallest, eigenvalues_of(model::pseudo_inertia_matrix(link))[0]);
  }
  return smallest;
}

void MovingHorizon::Impl::put_spread() {
  TriangularFactor all = window.factor(static_cast<int>(unknown.size()));
  all.add(arrival);
  MatrixXd spread = covariance(all);
  // The window counts as one instant, its middle; the value now may be a walk of half its length away.
  spread.diagonal() += walk(0.5 * options.window).cwiseAbs2();
  estimate.determined = narrow(spread);
  estimate.std = (problem->T * spread * problem->T.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
  for (int j = 0; j < columns->num_joints(); ++j) estimate.noise_std[j] = window.noise(j).std;
}

MovingHorizon::MovingHorizon(const model::Robot& robot, const HorizonOptions& options) {
  check_options(robot, options);
  impl_ = std::make_unique<Impl>(robot, options);
}

MovingHorizon::~MovingHorizon() = default;
MovingHorizon::MovingHorizon(const MovingHorizon& other) : impl_(std::make_unique<Impl>(*other.impl_)) {}
MovingHorizon& MovingHorizon::operator=(const MovingHorizon& other) {
  if (this != &other) impl_ = std::make_unique<Impl>(*other.impl_);
  return *this;
}
MovingHorizon::MovingHorizon(MovingHorizon&&) noexcept = default;
MovingHorizon& MovingHorizon::operator=(MovingHorizon&&) noexcept = default;

HorizonStatus MovingHorizon::push(const HorizonSample& sample) {
  Impl& own = *impl_;
  const Index n = own.columns->num_joints();
  if (sample.q.size() != n || sample.tau.size() != n || (sample.qd.size() != n && sample.qd.size() != 0)) {
    throw ModelError(
        fmt::format("moving horizon: a sample of {} positions, {} velocities and {} torques; expected {} "
                    "of each (velocities may be missing)",
                    sample.q.size(), sample.qd.size(), sample.tau.size(), n));
  }
  std::optional<HorizonTick> tick;
  const Status status = own.rows.add(sample, tick);
  if (status == Status::kNonFiniteInput) return HorizonStatus::kNotFinite;
  if (status != Status::kOk) return HorizonStatus::kTimeNotIncreasing;
  if (std::isnan(own.first)) own.first = own.last_step = sample.time;
  if (tick) {
    if (own.problem) {
      tick->y -= tick->W * own.problem->x0;
      tick->W = MatrixXd(tick->W * own.problem->T);
    }
    own.window.add(std::move(*tick));
  }
  if (sample.time - own.last_step < own.options.period) return HorizonStatus::kCollected;
  own.last_step = sample.time;
  return own.step(sample.time);
}

const HorizonEstimate& MovingHorizon::estimate() const { return impl_->estimate; }

void MovingHorizon::forget() {
  impl_->window.clear();
  if (impl_->problem) impl_->arrival = impl_->prior();
  impl_->arrival_time = kNaN;
  HorizonEstimate& estimate = impl_->estimate;
  std::fill(estimate.determined.begin(), estimate.determined.end(), false);
  std::fill(estimate.excited.begin(), estimate.excited.end(), false);
  estimate.std.setConstant(kNaN);
}

}  // namespace heft::identify
