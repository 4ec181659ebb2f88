#include "heft/identify/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/identify/instrumental.hpp"
#include "heft/identify/robust.hpp"
#include "heft/identify/total_least_squares.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/regression/block_groups.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "heft/statistics/residual_moments.hpp"
#include "heft/statistics/residual_statistics.hpp"

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

/// Blocks at first; merged to several correlation times before the intervals are made [s].
constexpr double kBlock = 0.5;

double duration_of(const Logs& logs) {
  double duration = 0.0;
  for (const data::MotionStream* log : logs)
    duration += log->summary().moving_to - log->summary().moving_from;
  return duration;
}

/// Joints at rest in every log, from 1.
std::vector<int> resting_joints(const regression::RegressionColumns& columns, const Logs& logs) {
  std::vector<int> resting;
  for (int j = 0; j < columns.num_joints(); ++j) {
    double travel = 0.0;
    for (const data::MotionStream* log : logs) travel = std::max(travel, log->summary().travel[j]);
    if (travel < 5e-3) resting.push_back(j + 1);
  }
  return resting;
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

/// A least squares problem in columns of norm 1, steadied by a ridge where asked for.
struct Solution {
  Eigen::VectorXd beta;
  Eigen::VectorXd scale;     ///< norms of the columns
  Eigen::MatrixXd right;     ///< right singular vectors of the scaled triangle
  Eigen::VectorXd singular;  ///< singular values, largest first
  double condition{0.0};
  double ridge{0.0};  ///< added to the scaled information
  /// How much of each parameter comes from the rows, 0..1: diagonal of V diag(σ²/(σ² + λ)) Vᵀ.
  Eigen::VectorXd resolution;
};

/// β = argmin ‖R β − z‖² + λ ‖S (β − β₀)‖², S the column norms. λ = 0 unless the condition number passes the
/// limit; then λ = (σ_max/limit)², with which the steadied problem has about that condition number.
Solution solve(const regression::TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from) {
  Solution s;
  s.scale = data.R().colwise().norm();
  for (Eigen::Index i = 0; i < s.scale.size(); ++i) {
    if (!(s.scale[i] > 0.0)) s.scale[i] = 1.0;
  }
  const Eigen::MatrixXd scaled = data.R() * s.scale.cwiseInverse().asDiagonal();
  Svd svd = svd_of(scaled);
  s.singular = std::move(svd.values);
  s.right = std::move(svd.V);
  const double largest = s.singular[0];
  const double smallest = s.singular[s.singular.size() - 1];
  s.condition = smallest > 0.0 ? largest / smallest : std::numeric_limits<double>::infinity();
  if (ridge_from > 0.0 && s.condition > ridge_from) s.ridge = std::pow(largest / ridge_from, 2);
  // In y = S β: z − R β₀ = U Σ Vᵀ (y − y₀).
  const Eigen::VectorXd right_side = svd.U.transpose() * (data.z() - data.R() * prior);
  Eigen::VectorXd step = Eigen::VectorXd::Zero(s.singular.size());
  Eigen::VectorXd told = step;
  for (Eigen::Index i = 0; i < step.size(); ++i) {
    const double sigma = s.singular[i];
    if (sigma <= 1e-13 * largest) continue;
    step[i] = sigma * right_side[i] / (sigma * sigma + s.ridge);
    told[i] = sigma * sigma / (sigma * sigma + s.ridge);
  }
  s.resolution = s.right.cwiseAbs2() * told;
  s.beta = prior + (s.right * step).cwiseQuotient(s.scale);
  return s;
}

/// Scatter of every joint's residual; degrees of freedom are shared among joints by their rows.
Eigen::VectorXd noise_of(const regression::BlockFactors& factors, const Eigen::VectorXd& beta) {
  Eigen::VectorXd noise(factors.num_joints());
  double all_rows = 0.0;
  std::vector<regression::TriangularFactor> joints;
  for (int j = 0; j < factors.num_joints(); ++j) {
    joints.push_back(factors.joint(j));
    all_rows += static_cast<double>(joints.back().rows());
  }
  for (int j = 0; j < factors.num_joints(); ++j) {
    const regression::TriangularFactor& joint = joints[static_cast<std::size_t>(j)];
    const auto rows = static_cast<double>(joint.rows());
    const double freedom =
        std::max(1.0, rows * (1.0 - static_cast<double>(beta.size()) / std::max(all_rows, 1.0)));
    noise[j] = rows > 0.0 ? std::sqrt(joint.squared_error(beta) / freedom) : 0.0;
  }
  return noise;
}

/// 1/σ². A residual of nothing but rounding must not make a weight of infinity.
Eigen::VectorXd weights_of(const Eigen::VectorXd& noise) {
  const double floor = std::max(1e-9 * noise.maxCoeff(), 1e-12);
  return noise.cwiseMax(floor).cwiseAbs2().cwiseInverse();
}

struct Spread {
  Eigen::MatrixXd covariance;
  int blocks{0};
};

/// Delete-a-block covariance of a weighted least squares estimate, blocks joined to at least `length`.
Spread spread_of(const regression::BlockFactors& factors, const Eigen::VectorXd& weights,
                 const Solution& solution, double length, double edge_factor) {
  struct Group {
    Eigen::MatrixXd A;
    Eigen::VectorXd g;
  };
  // All in columns of norm 1: A = Σ w RᵀR, g = Σ w Rᵀ(z − R β).
  const auto b = solution.beta.size();
  const Eigen::VectorXd inverse = solution.scale.cwiseInverse();
  Eigen::MatrixXd A = solution.ridge * Eigen::MatrixXd::Identity(b, b);
  std::vector<Group> groups;
  for (const std::vector<int>& members : regression::groups_of(factors, length)) {
    Group& group = groups.emplace_back(Group{Eigen::MatrixXd::Zero(b, b), Eigen::VectorXd::Zero(b)});
    for (const int k : members) {
      for (int j = 0; j < factors.num_joints(); ++j) {
        const regression::TriangularFactor& factor = factors.factor(k, j);
        if (factor.rows() == 0) continue;
        const Eigen::MatrixXd R = factor.R() * inverse.asDiagonal();
        group.A.noalias() += weights[j] * (R.transpose() * R);
        group.g.noalias() += weights[j] * (R.transpose() * (factor.z() - factor.R() * solution.beta));
      }
    }
  }
  for (const Group& group : groups) A += group.A;
  Eigen::MatrixXd changes(b, static_cast<Eigen::Index>(groups.size()));
  Spread out;
  for (const Group& group : groups) {
    if (group.A.trace() <= 0.0) continue;
    // Without this block: (A − A_b) d = −g_b, since the whole gradient vanishes at the estimate.
    const Eigen::VectorXd d = solve_symmetric(A - group.A, -group.g);
    if (d.allFinite()) changes.col(out.blocks++) = d;
  }
  out.covariance = inverse.asDiagonal() *
                   statistics::jackknife_covariance(changes.leftCols(out.blocks), edge_factor) *
                   inverse.asDiagonal();
  return out;
}

/// A size a parameter can be expected to have on this robot: what "undetermined" is measured against.
Eigen::VectorXd expected_sizes(const regression::RegressionColumns& columns, const Eigen::VectorXd& torque) {
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

/// The motion that would show a parameter.
std::string motion_for(const regression::RegressionColumns& columns, const regression::Column& column) {
  const int joint = column.joint + 1;
  const bool prismatic =
      columns.robot().joints[static_cast<std::size_t>(column.joint)].joint.type == JointType::kPrismatic;
  switch (column.kind) {
    case regression::ColumnKind::kLink:
      if (column.entry == kMass) return fmt::format("accelerate link {} along different directions", joint);
      if (column.entry <= kMcz) {
        return fmt::format(
            "hold and move joint {} in many postures: gravity must pull on link {} from several sides", joint,
            joint);
      }
      return fmt::format(
          "turn link {} fast about several axes: joints up to {} together, with strong accelerations", joint,
          joint);
    case regression::ColumnKind::kRotorInertia:
      return fmt::format("accelerate joint {} strongly, in several postures of the joints beyond it", joint);
    case regression::ColumnKind::kCoulomb:
      return fmt::format("move joint {} in both directions at a slow, even speed", joint);
    case regression::ColumnKind::kViscous:
      return fmt::format("move joint {} at several speeds up to its fastest, in both directions", joint);
    case regression::ColumnKind::kOffset:
      return prismatic
                 ? fmt::format("move joint {} slowly in both directions", joint)
                 : fmt::format("move joint {} slowly in both directions over more than half a turn", joint);
    case regression::ColumnKind::kCouplingInertia:
    case regression::ColumnKind::kCouplingCoulomb:
    case regression::ColumnKind::kCouplingViscous: {
      const auto& pair = columns.structure().couplings[static_cast<std::size_t>(column.coupling)];
      return fmt::format("move joints {} and {} at different speeds, also against each other",
                         pair.driving + 1, pair.driven + 1);
    }
  }
  return {};
}

/// Undetermined parameters by the motion they lack.
std::vector<std::string> missing_motion(const regression::RegressionColumns& columns, const Fit& fit,
                                        const std::vector<int>& resting) {
  std::vector<std::string> lines;
  for (const int joint : resting) {
    lines.push_back(fmt::format(
        "joint {} never moved: move it (its friction, rotor inertia and the load beyond it stay unknown)",
        joint));
  }
  std::vector<std::pair<std::string, std::string>> by_motion;  // motion, names
  for (int i = 0; i < fit.base.count(); ++i) {
    if (fit.determined[static_cast<std::size_t>(i)]) continue;
    const regression::Column& column = columns[fit.base.kept[static_cast<std::size_t>(i)]];
    if (std::find(resting.begin(), resting.end(), column.joint + 1) != resting.end()) continue;
    const std::string motion = motion_for(columns, column);
    const std::string name = fit.base.name(columns, i);
    const auto found =
        std::find_if(by_motion.begin(), by_motion.end(), [&](const auto& m) { return m.first == motion; });
    if (found == by_motion.end()) {
      by_motion.emplace_back(motion, name);
    } else {
      found->second += ", " + name;
    }
  }
  for (const auto& [motion, names] : by_motion)
    lines.push_back(fmt::format("{}: not determined; {}", names, motion));
  return lines;
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

}  // namespace

Fit fit(const model::Robot& robot, const Logs& logs, const FitOptions& options) {
  Fit result;
  result.method = options.method;
  result.columns = std::make_shared<const regression::RegressionColumns>(robot, options.structure);
  const regression::RegressionColumns& columns = *result.columns;
  check_logs(columns, logs);
  const std::vector<int> resting = resting_joints(columns, logs);
  if (static_cast<int>(resting.size()) == columns.num_joints()) {
    throw NotIdentifiableError(
        "no joint moves in these logs: nothing can be identified; record a motion in which every joint turns "
        "back "
        "and forth at several speeds (heft excite designs one)");
  }
  const auto report = [&](double done) {
    if (options.progress) options.progress(done);
  };
  result.base = regression::find_base_parameters(columns);
  const regression::BaseParameters& base = result.base;
  const int n = columns.num_joints();
  const int b = base.count();

  // First pass: the triangle of every joint and block.
  regression::BlockFactors factors(n, b, kBlock);
  regression::for_each_observation(columns, base.kept, logs, options.observation,
                                   [&](const regression::ObservationRows& rows) {
                                     factors.add(rows.log, rows.joint, rows.time, rows.W, rows.tau);
                                   });
  report(0.35);
  result.rows = Eigen::VectorXi::Zero(n);
  for (int j = 0; j < n; ++j) result.rows[j] = static_cast<int>(factors.joint(j).rows());
  for (const data::MotionStream* log : logs) result.samples += log->summary().samples;
  if (result.samples < b) {
    throw DataError(fmt::format(
        "{}: {} samples for {} unknowns; expected at least {}, and better some seconds of motion; "
        "record a longer log",
        logs.front()->summary().path, result.samples, b, b));
  }
  if (result.rows.sum() <= b || result.rows.maxCoeff() <= b / n) {
    throw NotIdentifiableError(
        fmt::format("{} rows for {} unknowns: the logs are too short, or the arm hardly moves in them; "
                    "record at least {:.0f} s "
                    "of motion in which every joint turns back and forth at several speeds",
                    result.rows.sum(), b, 10.0));
  }

  const Eigen::VectorXd prior_x = columns.values(robot);
  const Eigen::VectorXd prior = base.regrouping * prior_x;

  // Weights from the scatter that the fit before leaves, until they rest.
  const bool equal_weights = options.method == Method::kOls;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(n);
  Solution solution = solve(factors.weighted(weights), prior, options.ridge_from_condition);
  for (int round = 0; round < 6 && !equal_weights; ++round) {
    const Eigen::VectorXd before = solution.beta;
    weights = weights_of(noise_of(factors, solution.beta));
    solution = solve(factors.weighted(weights), prior, options.ridge_from_condition);
    const double moved = solution.scale.cwiseProduct(solution.beta - before).norm();
    if (moved < 1e-6 * solution.scale.cwiseProduct(solution.beta).norm()) break;
  }
  const Eigen::VectorXd plain_noise = noise_of(factors, solution.beta);
  report(0.4);

  if (options.method == Method::kIrls) {
    RobustOptions robust_options;
    robust_options.solve = [&](const regression::TriangularFactor& data) {
      return solve(data, prior, options.ridge_from_condition).beta;
    };
    RobustFit robust = fit_robust(columns, base, logs, options.observation, solution.beta, plain_noise,
                                  robust_options, [&](double done) { report(0.4 + 0.2 * done); });
    // From here on the reweighted rows are the rows.
    factors = std::move(robust.factors);
    weights = weights_of(robust.noise_std);
    solution = solve(factors.weighted(weights), prior, options.ridge_from_condition);
    result.noise_std = robust.noise_std;
    if (!robust.converged) result.notes.push_back("reweighting did not converge; the last iterate is used");
    for (int j = 0; j < n; ++j) {
      if (robust.downweighted_share[j] > 0.03) {
        result.notes.push_back(
            fmt::format("joint {}: {:.1f} % of the samples are outliers and get less than half weight", j + 1,
                        100.0 * robust.downweighted_share[j]));
      }
    }
  }
  TotalLeastSquaresOptions tls_options;
  tls_options.exact = exact_columns(columns, base);
  if (options.method == Method::kTls) {
    const TotalLeastSquaresFit tls = total_least_squares(factors.weighted(weights), tls_options);
    if (!tls.separated) {
      result.notes.push_back(
          fmt::format("total least squares finds no generic solution: {} directions are left out; do not "
                      "trust their parameters",
                      tls.left_out));
    }
    solution.beta = tls.beta;
  }

  // Second pass: how the residual is correlated in time.
  statistics::ResidualMoments moments(n);
  regression::for_each_observation(
      columns, base.kept, logs, options.observation, [&](const regression::ObservationRows& rows) {
        moments.add(rows.log, rows.joint, rows.time, rows.tau - rows.W * solution.beta);
      });
  report(0.7);
  if (result.noise_std.size() == 0) result.noise_std = noise_of(factors, solution.beta);
  const statistics::ResidualStatistics residual{result.noise_std, moments.correlation_time(), 0.0};
  const double length = std::max(residual.block_length(duration_of(logs)), factors.block_length());
  const double edge_factor = residual.edge_factor(length);
  const Spread spread = spread_of(factors, weights, solution, length, edge_factor);

  result.beta = solution.beta;
  result.covariance = spread.covariance;
  result.blocks = spread.blocks;
  result.block_length = length;
  if (options.method == Method::kTls) {
    // The gradient of least squares does not vanish there: it has a spread of its own.
    const TotalLeastSquaresSpread tls =
        total_least_squares(factors, weights, tls_options, length, edge_factor);
    result.covariance = tls.covariance;
    result.blocks = tls.groups;
  }

  const bool instrumental = options.method == Method::kIv;
  if (instrumental ||
      (options.test_bias && (options.method == Method::kWls || options.method == Method::kOls))) {
    InstrumentOptions instruments;
    instruments.kind = options.instruments;
    if (options.instruments == Instruments::kReference) instruments.reference = options.reference;
    if (!instrumental) instruments.max_iterations = 1;
    const InstrumentalFit iv =
        fit_instrumental(columns, base, logs, options.observation, solution.beta, result.noise_std,
                         instruments, [&](double done) { report(0.7 + 0.25 * done); });
    const Eigen::VectorXd iv_weights = weights_of(result.noise_std);
    result.bias =
        test_bias(iv.sums, iv_weights, solution.beta, instruments.condition_limit, length, edge_factor);
    if (instrumental) {
      const InstrumentalEstimate estimate = solve_instrumental(
          iv.sums, iv_weights, solution.beta, instruments.condition_limit, length, edge_factor);
      result.beta = estimate.beta;
      result.covariance = estimate.covariance;
      result.blocks = estimate.groups;
      result.noise_std = iv.noise_std;
      result.notes.insert(result.notes.end(), iv.notes.begin(), iv.notes.end());
      if (!iv.converged && options.instruments != Instruments::kDelayed) {
        result.notes.push_back("the instruments did not converge; the last iterate is used");
      }
    }
  }
  result.std = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  result.half_width = statistics::interval_factor(result.blocks - 1) * result.std;
  result.condition = solution.condition;
  result.ridge = solution.ridge > 0.0;
  const Eigen::VectorXd raw = singular_values(factors.weighted(weights).R());
  result.condition_unscaled =
      raw[raw.size() - 1] > 0.0 ? raw[0] / raw[raw.size() - 1] : std::numeric_limits<double>::infinity();
  result.cutoff =
      options.observation.cutoff > 0.0 ? options.observation.cutoff : logs.front()->summary().cutoff;

  // Link parameters that give β.
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(n);
  for (const data::MotionStream* log : logs) torque = torque.cwiseMax(log->summary().max_torque);
  const Eigen::VectorXd size = expected_sizes(columns, torque);
  result.robot = robot;
  if (options.link_parameters || options.method == Method::kPhysical) {
    const PhysicalFit physical =
        fit_physical(columns, base, factors.weighted(weights_of(result.noise_std)), prior_x);
    result.repaired_prior = physical.repaired_prior;
    result.at_boundary = physical.at_boundary;
    result.physical_cost_ratio = physical.unconstrained_squared_error > 0.0
                                     ? physical.squared_error / physical.unconstrained_squared_error
                                     : 1.0;
    if (options.method == Method::kPhysical) {
      result.beta = physical.beta;
      columns.apply(physical.x, result.robot);
    } else {
      // From the physical set the least step to these β; it stays physical where β allow it.
      columns.apply(with_base(base, physical.x, result.beta, size), result.robot);
    }
    result.physically_consistent = model::is_physically_consistent(result.robot);
  }

  result.relative = result.half_width.cwiseQuotient(result.beta.cwiseAbs().cwiseMax(1e-300));
  // A parameter is determined when its value comes from the rows, and its interval is narrow against its value or what such a robot can have.
  result.determined.resize(static_cast<std::size_t>(b));
  for (int i = 0; i < b; ++i) {
    const double against = std::max(std::abs(result.beta[i]), size[base.kept[static_cast<std::size_t>(i)]]);
    result.determined[static_cast<std::size_t>(i)] =
        solution.resolution[i] > 0.9 && result.half_width[i] < 0.5 * against;
  }
  result.missing = missing_motion(columns, result, resting);
  report(1.0);
  return result;
}

namespace {

/// Place of a regression column among the 14 n parameters of a model file; -1: not one of them.
int place_of(const regression::Column& column, int num_joints) {
  const auto in_block = [&](int block) { return (kParametersPerLink + block) * num_joints + column.joint; };
  switch (column.kind) {
    case regression::ColumnKind::kLink: return kParametersPerLink * column.joint + column.entry;
    case regression::ColumnKind::kRotorInertia: return in_block(0);
    case regression::ColumnKind::kCoulomb: return in_block(1);
    case regression::ColumnKind::kViscous: return in_block(2);
    case regression::ColumnKind::kOffset: return in_block(3);
    case regression::ColumnKind::kCouplingInertia:
    case regression::ColumnKind::kCouplingCoulomb:
    case regression::ColumnKind::kCouplingViscous: return -1;
  }
  return -1;
}

/// Of the parameters that are base parameters by themselves; NaN for all others: what is felt only together with other
/// parameters, or was not determined, has no spread of its own that the logs could show.
Eigen::VectorXd standard_deviations_of(const Fit& fit) {
  const int n = fit.columns->num_joints();
  Eigen::VectorXd deviations = Eigen::VectorXd::Constant(14 * Eigen::Index{n}, kNaN);
  for (int i = 0; i < fit.base.count(); ++i) {
    const bool alone = (fit.base.regrouping.row(i).array() != 0.0).count() == 1;
    const int place = place_of((*fit.columns)[fit.base.kept[static_cast<std::size_t>(i)]], n);
    if (alone && place >= 0 && fit.determined[static_cast<std::size_t>(i)]) deviations[place] = fit.std[i];
  }
  return deviations;
}

}  // namespace

model::ModelFile Fit::model_file() const {
  model::ModelFile file = model::make_model(robot);
  file.provenance.method = to_string(method);
  file.standard_deviations = standard_deviations_of(*this);
  return file;
}

}  // namespace heft::identify
