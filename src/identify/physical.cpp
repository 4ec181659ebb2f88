#include "physical.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "physical_problem.hpp"
#include "physical_search.hpp"

namespace heft::identify {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Share of the squared error to which the limit without prior is followed.
constexpr double kLimitShare = 1e-4;
/// Newton decrement at which a step of the path is good enough, and at which a result is.
constexpr double kStepTolerance = 1e-4, kFinalTolerance = 1e-9;

void check_input(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                 const regression::TriangularFactor& data, const VectorXd& prior) {
  if (prior.size() != columns.count() || base.count() != data.columns() ||
      base.regrouping.rows() != base.count() || base.regrouping.cols() != columns.count()) {
    throw ModelError(
        fmt::format("physical fit: sizes do not belong together: {} parameters and a prior of {}; {} base "
                    "parameters, {} x {} "
                    "regrouping and a factor of {} columns",
                    columns.count(), prior.size(), base.count(), base.regrouping.rows(),
                    base.regrouping.cols(), data.columns()));
  }
  for (int k = 0; k < columns.count(); ++k) {
    if (!std::isfinite(prior[k])) {
      throw ModelError(fmt::format("physical fit: the prior of {} is not a finite number", columns[k].name));
    }
  }
  if (!data.full().allFinite()) throw ModelError("physical fit: the rows hold numbers that are not finite");
}

/// Smallest eigenvalue of each link's S.
VectorXd smallest_eigenvalues(const PhysicalProblem& problem, const VectorXd& s) {
  std::vector<double> values;
  for (const PhysicalBlock& block : problem.blocks) {
    if (block.kind == Unknown::kLink) {
      values.push_back(eigenvalues_of(to_symmetric(s.segment<10>(block.first)))[0]);
    } else if (block.kind == Unknown::kPositive) {
      values.push_back(s[block.first]);
    }
  }
  return Eigen::Map<VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Sum of traces: size of a set of parameters in units of the prior.
double trace(const PhysicalProblem& problem, const VectorXd& s) {
  double sum = 0.0;
  for (const PhysicalBlock& block : problem.blocks) {
    if (block.kind == Unknown::kLink) sum += s.segment<4>(block.first).sum();
    if (block.kind == Unknown::kPositive) sum += s[block.first];
    if (block.kind == Unknown::kFree) sum += 0.5 * s[block.first] * s[block.first];
  }
  return sum;
}

/// Bound on f(s) − f(s') for physical s' with traces no larger than those of s. f is convex, so
/// f(s') ≥ f(s) + ⟨Z, s' − s⟩ with Z its gradient, and ⟨Z, S'⟩ ≥ min(0, λ_min(Z)) tr S'.
double duality_gap(const PhysicalProblem& problem, const VectorXd& s) {
  const VectorXd gradient = 2.0 * problem.A.transpose() * (problem.A * s - problem.z);
  double gap = gradient.dot(s);
  for (const PhysicalBlock& block : problem.blocks) {
    if (block.kind == Unknown::kLink) {
      const double least = eigenvalues_of(to_symmetric(gradient.segment<10>(block.first)))[0];
      gap += std::max(0.0, -least) * s.segment<4>(block.first).sum();
    } else if (block.kind == Unknown::kPositive) {
      gap += std::max(0.0, -gradient[block.first]) * s[block.first];
    } else {
      gap += std::abs(gradient[block.first] * s[block.first]);
    }
  }
  return std::max(gap, 0.0);
}

/// The fit on its way: where the prior counts no more, then back to the weight that was asked for.
class Descent {
 public:
  Descent(const PhysicalProblem& problem, const regression::BaseParameters& base,
          const regression::TriangularFactor& data, const PhysicalOptions& options)
      : problem_(problem), base_(base), data_(data), options_(options) {}

  /// p: parameters of the regression.
  VectorXd parameters(const VectorXd& s) const { return problem_.x0 + problem_.T * s; }
  double squared_error(const VectorXd& s) const {
    return data_.squared_error(base_.regrouping * parameters(s));
  }
  /// Lowers the weight of the prior to where it counts no more; fills error, gap and convergence.
  void follow_to_limit(PhysicalFit& fit);
  /// The unknowns at the weight of the options, lowered until the prior costs no more than it may.
  VectorXd with_prior(PhysicalFit& fit) const;
  /// Links held back by the limit, and numbers that the data would rather have negative, which become 0.
  VectorXd settle_edges(const VectorXd& s, PhysicalFit& fit) const;

 private:
  bool descend(double factor, double floor, PhysicalFit& fit);

  const PhysicalProblem& problem_;
  const regression::BaseParameters& base_;
  const regression::TriangularFactor& data_;
  const PhysicalOptions& options_;
  std::vector<std::pair<double, PhysicalState>> path_;  ///< weight and state, falling weights
  VectorXd limit_;                                      ///< p: the unknowns at the end of the path
  VectorXd edge_;                                       ///< smallest eigenvalues there, one a link or number
  /// Links and numbers whose eigenvalue is below this approach the edge as fast as the weight falls.
  VectorXd edge_before_;
};

/// Follows the path in steps of the weight of this factor. @return whether to its end
bool Descent::descend(double factor, double floor, PhysicalFit& fit) {
  PhysicalState state = at_prior(problem_);
  limit_ = to_s(problem_, state);
  edge_ = smallest_eigenvalues(problem_, limit_);
  edge_before_ = VectorXd::Zero(edge_.size());
  fit.limit_squared_error = squared_error(limit_);
  double weight = std::max(fit.limit_squared_error, floor) / problem_.degree;
  path_.clear();
  if (!(weight > 0.0)) {  // no data at all: the prior
    path_.emplace_back(weight, state);
    fit.converged = true;
    return true;
  }
  bool complete = false, reached = true;
  while (reached && !complete) {
    reached = solve_stage(problem_, weight, kStepTolerance, options_.max_iterations, state, fit.iterations);
    path_.emplace_back(weight, state);
    limit_ = to_s(problem_, state);
    edge_before_ = edge_ * (1.2 * std::sqrt(factor));
    edge_ = smallest_eigenvalues(problem_, limit_);
    // On this path f exceeds its least value by weight · (degree + trace) at most.
    const double cost = weight * (problem_.degree + trace(problem_, limit_));
    complete = reached && path_.size() > 2 && cost <= kLimitShare * std::max(squared_error(limit_), floor);
    weight *= factor;
  }
  solve_stage(problem_, path_.back().first, kFinalTolerance, options_.max_iterations, path_.back().second,
              fit.iterations);
  limit_ = to_s(problem_, path_.back().second);
  fit.limit_squared_error = squared_error(limit_);
  // What counts is not how the solver felt but how far any other solution can be below this one.
  fit.gap = std::min(duality_gap(problem_, limit_),
                     std::max(fit.limit_squared_error - fit.unconstrained_squared_error, 0.0));
  fit.converged = fit.gap <= 2.0 * kLimitShare * std::max(fit.limit_squared_error, floor);
  return complete;
}

void Descent::follow_to_limit(PhysicalFit& fit) {
  // Least error worth going for, also of data without noise: a millionth of the torque.
  const double floor = 1e-12 * data_.full().col(base_.count()).squaredNorm();
  // Tenfold steps; should that fail, once more in smaller ones. The gap knows of solutions no larger than this one
  // only; the path, followed to its end, of all.
  for (const double factor : {0.1, 0.4}) {
    const bool complete = descend(factor, floor, fit);
    if (fit.converged && complete) return;
  }
}

VectorXd Descent::with_prior(PhysicalFit& fit) const {
  // With f/σ² for −2 log-likelihood and f/rows for σ², a weight of 2 f/rows counts the divergence as minus the
  // logarithm of a probability.
  double weight =
      options_.prior_weight * 2.0 * fit.limit_squared_error / static_cast<double>(std::max(data_.rows(), 1L));
  for (; options_.prior_share > 0.0 && weight > path_.back().first; weight *= 0.5) {
    std::size_t start = 0;
    while (start + 1 < path_.size() && path_[start + 1].first > weight) ++start;
    PhysicalState state = path_[start].second;
    solve_stage(problem_, weight, kFinalTolerance, options_.max_iterations, state, fit.iterations);
    VectorXd s = to_s(problem_, state);
    if (squared_error(s) <= (1.0 + options_.prior_share) * fit.limit_squared_error) return s;
  }
  return limit_;
}

VectorXd Descent::settle_edges(const VectorXd& s, PhysicalFit& fit) const {
  const double error = squared_error(s);
  const VectorXd gradient = 2.0 * problem_.A.transpose() * (problem_.A * limit_ - problem_.z);
  std::vector<std::pair<double, int>> loads;  // what the limit holds back, and the link
  Eigen::Index index = 0;
  VectorXd settled = s;
  for (const PhysicalBlock& block : problem_.blocks) {
    if (block.kind == Unknown::kFree) continue;
    const bool at_edge = edge_[index] < 0.01 && edge_[index] < edge_before_[index];
    ++index;
    if (!at_edge) continue;
    if (block.kind == Unknown::kLink) {
      loads.emplace_back(gradient.segment<4>(block.first).sum(), block.link + 1);
    } else {
      VectorXd trial = settled;
      trial[block.first] = 0.0;
      if (squared_error(trial) <= error * (1.0 + 1e-6)) {
        settled = trial;
        fit.at_zero.push_back(block.first);
      }
    }
  }
  // Links share what no motion separates, so one that is held back holds its neighbours a little too.
  std::sort(loads.rbegin(), loads.rend());
  for (const auto& [load, link] : loads) {
    if (load >= 0.1 * loads.front().first) fit.at_boundary.push_back(link);
  }
  return settled;
}

}  // namespace

PhysicalFit fit_physical(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                         const regression::TriangularFactor& data, const VectorXd& prior,
                         const PhysicalOptions& options) {
  check_input(columns, base, data, prior);
  PriorChanges changes;
  const PhysicalProblem problem = make_problem(columns, base, data, prior, options.margin, changes);
  PhysicalFit fit;
  fit.repaired_prior = changes.repaired;
  fit.rescaled_prior = changes.rescaled;
  fit.unconstrained_squared_error = data.squared_error(least_squares(data.R(), data.z()));
  Descent descent(problem, base, data, options);
  descent.follow_to_limit(fit);
  const VectorXd s = descent.settle_edges(descent.with_prior(fit), fit);
  fit.squared_error = descent.squared_error(s);
  fit.x = descent.parameters(s);
  fit.beta = base.regrouping * fit.x;
  fit.summary = fmt::format(
      "{} in {} iterations; squared error {:.6g}, without prior {:.6g} (to {:.2g}), least squares {:.6g}",
      fit.converged ? "converged" : "did not converge", fit.iterations, fit.squared_error,
      fit.limit_squared_error, fit.gap, fit.unconstrained_squared_error);
  return fit;
}

}  // namespace heft::identify
