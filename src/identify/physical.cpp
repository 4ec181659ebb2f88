#include "heft/identify/physical.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <random>

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "heft/core/inertia.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/physical_links.hpp"

namespace heft::identify {
namespace {

using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Matrix10 = Eigen::Matrix<double, 10, 10>;
using Vector10 = Eigen::Matrix<double, 10, 1>;

/// Share of the squared error to which the limit without prior is followed.
constexpr double kLimitShare = 1e-4;

constexpr double kSqrt2 = 1.4142135623730951;

/// Entries of a symmetric 4 × 4 matrix in the order used here, row ≤ column.
constexpr std::array<std::array<int, 2>, 10> kEntry{
    {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}}};

/// Symmetric matrix to ten numbers with the same inner product.
Vector10 to_vector(const Matrix4d& S) {
  Vector10 s;
  for (int k = 0; k < 10; ++k) {
    const auto [i, j] = kEntry[static_cast<std::size_t>(k)];
    s[k] = i == j ? S(i, i) : kSqrt2 * S(i, j);
  }
  return s;
}

Matrix4d to_symmetric(const Eigen::Ref<const Vector10>& s) {
  Matrix4d S;
  for (int k = 0; k < 10; ++k) {
    const auto [i, j] = kEntry[static_cast<std::size_t>(k)];
    S(i, j) = i == j ? s[k] : s[k] / kSqrt2;
    S(j, i) = S(i, j);
  }
  return S;
}

/// Upper triangular C with C Cᵀ = S; false when S is not positive definite.
bool to_upper(const Matrix4d& S, Matrix4d& C) {
  // Turned end for end, the lower triangular factor is an upper one.
  const Eigen::LLT<Matrix4d> turned(S.reverse());
  if (turned.info() != Eigen::Success) return false;
  C = Matrix4d(turned.matrixL()).reverse();
  return true;
}

/// A rod from the joint to the next one: what a link is when nothing is known of it.
Matrix4d plausible_body(double mass, const Vector3d& center, const Vector3d& extent, double least_length) {
  const double length = std::max(extent.norm(), least_length);
  const double radius = 0.25 * length;
  Matrix4d P = Matrix4d::Zero();
  // Σ = m (c cᵀ + d dᵀ / 12 + ¼ r² E): rod along d, as thick in every direction as a cylinder of radius r.
  P.topLeftCorner<3, 3>() = mass * (center * center.transpose() + extent * extent.transpose() / 12.0 +
                                    0.25 * radius * radius * Eigen::Matrix3d::Identity());
  P.topRightCorner<3, 1>() = mass * center;
  P.bottomLeftCorner<1, 3>() = mass * center.transpose();
  P(3, 3) = mass;
  return P;
}

/// Priors of the links that can be used: positive definite and not extremely thin.
std::vector<Matrix4d> usable_priors(const regression::RegressionColumns& columns, const VectorXd& prior,
                                    std::vector<int>& repaired) {
  const model::Robot& robot = columns.robot();
  const std::size_t n = robot.joints.size();
  std::vector<InertialParameters<double>> links(n);
  std::vector<Vector3d> extents(n);
  std::vector<double> masses;
  double longest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 10; ++k) links[i][k] = prior[static_cast<Eigen::Index>(10 * i + k)];
    const auto& next = i + 1 < n ? robot.joints[i + 1].joint.position : robot.tip_position;
    extents[i] = Vector3d(next[0], next[1], next[2]);
    longest = std::max(longest, extents[i].norm());
    if (links[i][kMass] > 0.0) masses.push_back(links[i][kMass]);
  }
  if (longest == 0.0) longest = 0.3;
  double typical_mass = 1.0;
  if (!masses.empty()) {
    const auto middle = masses.begin() + static_cast<std::ptrdiff_t>(masses.size() / 2);
    std::nth_element(masses.begin(), middle, masses.end());
    typical_mass = *middle;
  }

  std::vector<Matrix4d> priors(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!model::is_physical(links[i])) repaired.push_back(static_cast<int>(i) + 1);
    const double mass = links[i][kMass];
    if (mass <= 0.0) {
      priors[i] = plausible_body(typical_mass, 0.5 * extents[i], extents[i], 0.3 * longest);
      continue;
    }
    // Second moments that are too small (or negative) are lifted to a hundredth of those of a rod with the same
    // mass and centre: a prior of a point mass would forbid any inertia.
    const Vector3d center = Vector3d(links[i][kMcx], links[i][kMcy], links[i][kMcz]) / mass;
    const Matrix4d body = plausible_body(mass, center, extents[i], 0.3 * longest);
    const Matrix4d root = body.llt().matrixL();
    const auto lower = root.triangularView<Eigen::Lower>();
    const Matrix4d half = lower.solve(model::pseudo_inertia_matrix(links[i]));
    const Matrix4d relative = lower.solve(half.transpose());
    const Eigensystem eigen = eigensystem_of(0.5 * (relative + relative.transpose()));
    const Matrix4d lifted =
        eigen.vectors * eigen.values.cwiseMax(0.01).asDiagonal() * eigen.vectors.transpose();
    priors[i] = eigen.values[0] < 0.01 ? Matrix4d(root * lifted * root.transpose())
                                       : model::pseudo_inertia_matrix(links[i]);
  }
  return priors;
}

/// How an unknown enters: ten of a link, one that stays positive, one that is free.
enum class Kind { kLink, kPositive, kFree };

struct Block {
  Kind kind;
  int first;  ///< of its unknowns, and of its columns
  int size;
  int link{-1};
};

/// The problem in units of the prior. A link is P = L (ε E + (1 − ε) S) Lᵀ with P₀ = L Lᵀ, a positive number
/// y₀ s, a free one y₀ + c s. All stacked, x = x₀ + T s, and the data say ‖A s − z‖².
struct Problem {
  std::vector<Block> blocks;
  VectorXd x0;
  MatrixXd T;  ///< p × p, block diagonal
  MatrixXd A;  ///< b × p
  VectorXd z;
  double degree{0.0};  ///< of the barrier: 4 a link, 1 a positive number
};

/// State of the search: a factor U of each link's S = U Uᵀ, a positive number, or a free one. Links cannot
/// but be positive definite.
struct State {
  std::vector<Matrix4d> U;  ///< per block; (0, 0) holds the number of the others
};

State at_prior(const Problem& problem) {
  State state;
  for (const Block& block : problem.blocks) {
    state.U.emplace_back(Matrix4d::Identity());
    if (block.kind == Kind::kFree) state.U.back()(0, 0) = 0.0;
  }
  return state;
}

VectorXd to_s(const Problem& problem, const State& state) {
  VectorXd s(problem.x0.size());
  for (std::size_t i = 0; i < problem.blocks.size(); ++i) {
    const Block& block = problem.blocks[i];
    if (block.kind == Kind::kLink) {
      s.segment<10>(block.first) = to_vector(state.U[i] * state.U[i].transpose());
    } else {
      s[block.first] = state.U[i](0, 0);
    }
  }
  return s;
}

/// What one round minimises, over the weight of the prior: ‖A s − z‖²/μ + d, less its value at the start so that
/// small steps are not lost in rounding. Its unknowns y move the state to
///
///   S = U (E + V) Uᵀ,  number s₀ (1 + v),  free number s₀ + v,   v = M y,
///
/// with M such that the curvature at the start is 1 in every direction. s is linear in y, so the function is
/// convex, and the torque that the data fix stays fixed along a straight line. In log-Cholesky coordinates
/// proper it does not, and the search creeps along a curved valley.
class Objective : public ceres::FirstOrderFunction {
 public:
  Objective(const Problem& problem, const State& state, double weight)
      : problem_(problem), state_(state), weight_(weight), Av_(problem.A) {
    const Eigen::Index p = problem.A.cols();
    s_ = to_s(problem_, state_);
    slope_ = VectorXd::Zero(p);
    for (std::size_t i = 0; i < problem_.blocks.size(); ++i) {
      const Block& block = problem_.blocks[i];
      if (block.kind == Kind::kLink) {
        const Matrix4d& U = state_.U[i];
        Matrix10 ds;
        for (int k = 0; k < 10; ++k)
          ds.col(k) = to_vector(U * to_symmetric(Vector10::Unit(k)) * U.transpose());
        Av_.middleCols<10>(block.first) = problem_.A.middleCols<10>(block.first) * ds;
        slope_.segment<10>(block.first) = to_vector(U.transpose() * U);
      } else if (block.kind == Kind::kPositive) {
        Av_.col(block.first) *= s_[block.first];
        slope_[block.first] = s_[block.first];
      } else {
        slope_[block.first] = s_[block.first];
      }
    }
    r_ = problem_.A * s_ - problem_.z;
    M_ = preconditioner(std::sqrt(2.0 / weight_) * Av_);
  }

  int NumParameters() const override { return static_cast<int>(s_.size()); }

  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    const Eigen::Map<const VectorXd> y(parameters, NumParameters());
    const VectorXd v = M_ * y;
    const VectorXd change = Av_ * v;
    VectorXd g = slope_;
    // Divergence from the prior: tr S − log det S − 4, s − log s − 1, s²/2.
    double d = slope_.dot(v);
    for (const Block& block : problem_.blocks) {
      if (block.kind == Kind::kLink) {
        const Matrix4d inner = Matrix4d::Identity() + to_symmetric(v.segment<10>(block.first));
        const Eigen::LLT<Matrix4d> factor(inner);
        if (factor.info() != Eigen::Success) return false;
        for (int k = 0; k < 4; ++k) d -= 2.0 * std::log(factor.matrixLLT()(k, k));
        g.segment<10>(block.first) -= to_vector(factor.solve(Matrix4d::Identity()));
      } else if (block.kind == Kind::kPositive) {
        const double inner = 1.0 + v[block.first];
        if (!(inner > 0.0)) return false;
        d -= std::log(inner);
        g[block.first] -= 1.0 / inner;
      } else {
        d += 0.5 * v[block.first] * v[block.first];
        g[block.first] += v[block.first];
      }
    }
    *cost = change.dot(change + 2.0 * r_) / weight_ + d;
    if (!std::isfinite(*cost)) return false;
    if (gradient != nullptr) {
      g += Av_.transpose() * (r_ + change) * (2.0 / weight_);
      Eigen::Map<VectorXd>(gradient, NumParameters()) = M_.transpose() * g;
    }
    return true;
  }

  /// The state at y. @return false when that is none
  bool move(const VectorXd& y, State& state) const {
    const VectorXd v = M_ * y;
    State moved = state_;
    for (std::size_t i = 0; i < problem_.blocks.size(); ++i) {
      const Block& block = problem_.blocks[i];
      double& number = moved.U[i](0, 0);
      if (block.kind == Kind::kLink) {
        Matrix4d C;
        if (!to_upper(Matrix4d::Identity() + to_symmetric(v.segment<10>(block.first)), C)) return false;
        moved.U[i] = state_.U[i] * C;
      } else if (block.kind == Kind::kPositive) {
        number *= 1.0 + v[block.first];
        if (!(number > 0.0)) return false;
      } else {
        number += v[block.first];
      }
    }
    state = std::move(moved);
    return true;
  }

 private:
  /// M with Mᵀ (E + BᵀB) M = E: E is the curvature of the divergence in v, BᵀB that of the data.
  ///
  /// E + BᵀB is E but for the few directions of B's rows, Bᵀ = Q R; there it is E + R Rᵀ = C Cᵀ. So
  /// M = E − Q Qᵀ + Q C⁻ᵀ Qᵀ. Directions that the data do not see stay exact however small μ is.
  static MatrixXd preconditioner(const MatrixXd& B) {
    const Eigen::Index b = B.rows(), p = B.cols(), k = std::min(b, p);
    const auto [Q, R] = qr_of(B.transpose());
    // C Cᵀ = E + R Rᵀ by QR of [Rᵀ; E], without squaring R.
    MatrixXd stacked(b + k, k);
    stacked << R.transpose(), MatrixXd::Identity(k, k);
    const MatrixXd Ct = triangle_of(stacked);
    const MatrixXd inverse = Ct.triangularView<Eigen::Upper>().solve(MatrixXd::Identity(k, k));
    return MatrixXd::Identity(p, p) + Q * ((inverse - MatrixXd::Identity(k, k)) * Q.transpose());
  }

  const Problem& problem_;
  State state_;
  double weight_;
  MatrixXd Av_;             ///< A ∂s/∂v
  VectorXd s_, r_, slope_;  ///< s and A s − z at the start; slope of the divergence without its logarithms
  MatrixXd M_;
};

/// Minimises at one weight. @return whether it converged; the state is moved in any case.
bool solve_stage(const Problem& problem, double weight, double tolerance, int max_iterations, State& state,
                 int& iterations) {
  constexpr int kRounds = 40;
  constexpr int kIterationsPerRound = 12;
  for (int round = 0; round < kRounds; ++round) {
    auto* objective = new Objective(problem, state, weight);
    const ceres::GradientProblem gradient_problem(objective);  // owns the objective
    VectorXd y = VectorXd::Zero(objective->NumParameters()), gradient = y;
    double cost = 0.0;
    if (!objective->Evaluate(y.data(), &cost, gradient.data())) return false;
    // In these coordinates |gradient|² is the Newton decrement: twice what is left to gain.
    if (gradient.squaredNorm() < tolerance) return true;
    if (iterations >= max_iterations) return false;
    ceres::GradientProblemSolver::Options options;
    options.line_search_direction_type = ceres::BFGS;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = std::min(kIterationsPerRound, max_iterations - iterations);
    options.function_tolerance = 0.0;
    options.parameter_tolerance = 0.0;
    options.gradient_tolerance = 0.1 * std::sqrt(tolerance / static_cast<double>(y.size()));
    ceres::GradientProblemSolver::Summary summary;
    ceres::Solve(options, gradient_problem, y.data(), &summary);
    const int taken = static_cast<int>(summary.iterations.size()) - 1;
    iterations += std::max(taken, 1);
    if (!(summary.final_cost <= summary.initial_cost) || y.isZero(0.0) || !objective->move(y, state))
      return false;
  }
  return false;
}

/// Smallest eigenvalue of each link's S.
VectorXd smallest_eigenvalues(const Problem& problem, const VectorXd& s) {
  std::vector<double> values;
  for (const Block& block : problem.blocks) {
    if (block.kind == Kind::kLink) {
      values.push_back(eigenvalues_of(to_symmetric(s.segment<10>(block.first)))[0]);
    } else if (block.kind == Kind::kPositive) {
      values.push_back(s[block.first]);
    }
  }
  return Eigen::Map<VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Sum of traces: size of a set of parameters in units of the prior.
double trace(const Problem& problem, const VectorXd& s) {
  double sum = 0.0;
  for (const Block& block : problem.blocks) {
    if (block.kind == Kind::kLink) sum += s.segment<4>(block.first).sum();
    if (block.kind == Kind::kPositive) sum += s[block.first];
    if (block.kind == Kind::kFree) sum += 0.5 * s[block.first] * s[block.first];
  }
  return sum;
}

/// Bound on f(s) − f(s') for physical s' with traces no larger than those of s. f is convex, so
/// f(s') ≥ f(s) + ⟨Z, s' − s⟩ with Z its gradient, and ⟨Z, S'⟩ ≥ min(0, λ_min(Z)) tr S'.
double duality_gap(const Problem& problem, const VectorXd& s) {
  const VectorXd gradient = 2.0 * problem.A.transpose() * (problem.A * s - problem.z);
  double gap = gradient.dot(s);
  for (const Block& block : problem.blocks) {
    if (block.kind == Kind::kLink) {
      const double least = eigenvalues_of(to_symmetric(gradient.segment<10>(block.first)))[0];
      gap += std::max(0.0, -least) * s.segment<4>(block.first).sum();
    } else if (block.kind == Kind::kPositive) {
      gap += std::max(0.0, -gradient[block.first]) * s[block.first];
    } else {
      gap += std::abs(gradient[block.first] * s[block.first]);
    }
  }
  return std::max(gap, 0.0);
}

/// How much of each column explains the data best: least squares with least values, by cyclic descent. Rough is
/// enough, it only sets units.
VectorXd rough_sizes(const MatrixXd& columns, const VectorXd& z, const VectorXd& start,
                     const VectorXd& least) {
  constexpr double kPull = 1e-3;
  VectorXd size = start.cwiseMax(least);
  VectorXd left = z - columns * size;
  for (int sweep = 0; sweep < 200; ++sweep) {
    for (Eigen::Index k = 0; k < size.size(); ++k) {
      const double curvature = columns.col(k).squaredNorm();
      if (!(curvature > 0.0)) continue;
      const double step =
          (columns.col(k).dot(left) / curvature + kPull * (start[k] - size[k])) / (1.0 + kPull);
      const double next = std::max(size[k] + step, least[k]);
      left -= columns.col(k) * (next - size[k]);
      size[k] = next;
    }
  }
  return size;
}

Problem make_problem(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                     const regression::TriangularFactor& data, const VectorXd& prior, double margin,
                     PhysicalFit& fit) {
  const int n = columns.num_joints(), p = columns.count();
  const MatrixXd W = data.R() * base.regrouping;
  const VectorXd z = data.z();
  std::vector<Matrix4d> priors = usable_priors(columns, prior, fit.repaired_prior);

  // What the whole of each link, and each other parameter, is about. A link whose prior is more than tenfold too
  // light gets its size from here, or the way to it would be long.
  MatrixXd whole(W.rows(), p - 9 * n);
  VectorXd start = VectorXd::Zero(p - 9 * n), least = start;
  for (int i = 0; i < n; ++i) {
    const InertialParameters<double> link = model::link_with(priors[static_cast<std::size_t>(i)]);
    whole.col(i) = W.middleCols<10>(10 * i) * Eigen::Map<const Vector10>(link.data());
    start[i] = 1.0;
    least[i] = 0.1;
  }
  for (int k = 10 * n; k < p; ++k) {
    whole.col(k - 9 * n) = W.col(k);
    start[k - 9 * n] = prior[k];
    least[k - 9 * n] =
        columns[k].kind == regression::ColumnKind::kOffset ? -std::numeric_limits<double>::infinity() : 0.0;
  }
  const VectorXd sizes = rough_sizes(whole, z, start, least);
  for (int i = 0; i < n; ++i) {
    if (!(sizes[i] > 10.0)) continue;
    priors[static_cast<std::size_t>(i)] *= sizes[i];
    fit.rescaled_prior.push_back(i + 1);
  }

  Problem problem;
  problem.x0 = VectorXd::Zero(p);
  problem.T = MatrixXd::Zero(p, p);
  for (int i = 0; i < n; ++i) {
    const Matrix4d L = priors[static_cast<std::size_t>(i)].llt().matrixL();
    const InertialParameters<double> edge = model::link_with(margin * priors[static_cast<std::size_t>(i)]);
    problem.x0.segment<10>(10 * i) = Eigen::Map<const Vector10>(edge.data());
    for (int k = 0; k < 10; ++k) {
      const Matrix4d E = to_symmetric(Vector10::Unit(k));
      const InertialParameters<double> column = model::link_with((1.0 - margin) * (L * E * L.transpose()));
      problem.T.block<10, 1>(10 * i, 10 * i + k) = Eigen::Map<const Vector10>(column.data());
    }
    problem.blocks.push_back({Kind::kLink, 10 * i, 10, i});
    problem.degree += 4.0;
  }
  for (int k = 10 * n; k < p; ++k) {
    // In units of what the data give it, at least a hundredth of what would explain the whole torque.
    const double norm = W.col(k).norm();
    const double unit = norm > 0.0 ? std::max(std::abs(sizes[k - 9 * n]), 0.01 * z.norm() / norm) : 0.0;
    if (columns[k].kind == regression::ColumnKind::kOffset) {
      problem.x0[k] = prior[k];
      problem.T(k, k) = unit;
      problem.blocks.push_back({Kind::kFree, k, 1});
    } else {
      problem.T(k, k) = prior[k] > 0.1 * unit ? prior[k] : unit;
      problem.blocks.push_back({Kind::kPositive, k, 1});
      problem.degree += 1.0;
    }
  }
  problem.A = W * problem.T;
  problem.z = z - W * problem.x0;
  return problem;
}

}  // namespace

PhysicalFit fit_physical(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                         const regression::TriangularFactor& data, const VectorXd& prior,
                         const PhysicalOptions& options) {
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

  PhysicalFit fit;
  const Problem problem = make_problem(columns, base, data, prior, options.margin, fit);
  const auto squared_error = [&](const VectorXd& s) {
    return data.squared_error(base.regrouping * (problem.x0 + problem.T * s));
  };

  const MatrixXd R = data.R();
  fit.unconstrained_squared_error = data.squared_error(least_squares(R, data.z()));

  // Least error worth going for, also of data without noise: a millionth of the torque.
  const double floor = 1e-12 * data.full().col(base.count()).squaredNorm();
  // Tenfold steps of the weight down to where the prior counts no more; should that fail, once more in smaller
  // ones.
  std::vector<std::pair<double, State>> path;
  VectorXd limit, edge, edge_before;
  for (const double factor : {0.1, 0.4}) {
    State state = at_prior(problem);
    limit = to_s(problem, state);
    edge = smallest_eigenvalues(problem, limit);
    edge_before = VectorXd::Zero(edge.size());
    fit.limit_squared_error = squared_error(limit);
    double weight = std::max(fit.limit_squared_error, floor) / problem.degree;
    path.clear();
    if (!(weight > 0.0)) {  // no data at all: the prior
      path.emplace_back(weight, state);
      fit.converged = true;
      break;
    }
    bool complete = false;
    while (true) {
      const bool reached = solve_stage(problem, weight, 1e-4, options.max_iterations, state, fit.iterations);
      path.emplace_back(weight, state);
      limit = to_s(problem, state);
      edge_before = edge * (1.2 * std::sqrt(factor));
      edge = smallest_eigenvalues(problem, limit);
      // On this path f exceeds its least value by weight · (degree + trace) at most.
      const double cost = weight * (problem.degree + trace(problem, limit));
      complete = reached && path.size() > 2 && cost <= kLimitShare * std::max(squared_error(limit), floor);
      if (!reached || complete) break;
      weight *= factor;
    }
    solve_stage(problem, weight, 1e-9, options.max_iterations, path.back().second, fit.iterations);
    limit = to_s(problem, path.back().second);
    fit.limit_squared_error = squared_error(limit);
    // What counts is not how the solver felt but how far any other solution can be below this one.
    fit.gap = std::min(duality_gap(problem, limit),
                       std::max(fit.limit_squared_error - fit.unconstrained_squared_error, 0.0));
    fit.converged = fit.gap <= 2.0 * kLimitShare * std::max(fit.limit_squared_error, floor);
    // The gap knows of solutions no larger than this one only; the path, followed to its end, of all.
    if (fit.converged && complete) break;
  }

  // Back up to the weight that was asked for. With f/σ² for −2 log-likelihood and f/rows for σ², a weight of
  // 2 f/rows counts the divergence as minus the logarithm of a probability.
  VectorXd s = limit;
  double weight =
      options.prior_weight * 2.0 * fit.limit_squared_error / static_cast<double>(std::max(data.rows(), 1L));
  for (; options.prior_share > 0.0 && weight > path.back().first; weight *= 0.5) {
    std::size_t start = 0;
    while (start + 1 < path.size() && path[start + 1].first > weight) ++start;
    State state = path[start].second;
    solve_stage(problem, weight, 1e-9, options.max_iterations, state, fit.iterations);
    s = to_s(problem, state);
    if (squared_error(s) <= (1.0 + options.prior_share) * fit.limit_squared_error) break;
    s = limit;
  }

  fit.squared_error = squared_error(s);
  const VectorXd gradient = 2.0 * problem.A.transpose() * (problem.A * limit - problem.z);
  std::vector<std::pair<double, int>> loads;  // what the limit holds back, and the link
  Eigen::Index index = 0;
  VectorXd snapped = s;
  for (const Block& block : problem.blocks) {
    if (block.kind == Kind::kFree) continue;
    const bool at_edge = edge[index] < 0.01 && edge[index] < edge_before[index];
    ++index;
    if (!at_edge) continue;
    if (block.kind == Kind::kLink) {
      loads.emplace_back(gradient.segment<4>(block.first).sum(), block.link + 1);
    } else {
      VectorXd trial = snapped;
      trial[block.first] = 0.0;
      if (squared_error(trial) <= fit.squared_error * (1.0 + 1e-6)) {
        snapped = trial;
        fit.at_zero.push_back(block.first);
      }
    }
  }
  // Links share what no motion separates, so one that is held back holds its neighbours a little too.
  std::sort(loads.rbegin(), loads.rend());
  for (const auto& [load, link] : loads) {
    if (load >= 0.1 * loads.front().first) fit.at_boundary.push_back(link);
  }
  s = snapped;
  fit.squared_error = squared_error(s);
  fit.x = problem.x0 + problem.T * s;
  fit.beta = base.regrouping * fit.x;
  fit.summary = fmt::format(
      "{} in {} iterations; squared error {:.6g}, without prior {:.6g} (to {:.2g}), least squares {:.6g}",
      fit.converged ? "converged" : "did not converge", fit.iterations, fit.squared_error,
      fit.limit_squared_error, fit.gap, fit.unconstrained_squared_error);
  return fit;
}

}  // namespace heft::identify
