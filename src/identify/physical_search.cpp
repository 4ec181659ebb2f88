#include "physical_search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <Eigen/Cholesky>

#include "heft/host/decompositions.hpp"

namespace heft::identify {

using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using Matrix10 = Eigen::Matrix<double, 10, 10>;

/// Upper triangular C with C Cᵀ = S; false when S is not positive definite.
bool to_upper(const Matrix4d& S, Matrix4d& C) {
  // Turned end for end, the lower triangular factor is an upper one.
  const Eigen::LLT<Matrix4d> turned(S.reverse());
  if (turned.info() != Eigen::Success) return false;
  C = Matrix4d(turned.matrixL()).reverse();
  return true;
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
  Objective(const PhysicalProblem& problem, const PhysicalState& state, double weight)
      : problem_(problem), state_(state), weight_(weight), Av_(problem.A) {
    const Eigen::Index p = problem.A.cols();
    s_ = to_s(problem_, state_);
    slope_ = VectorXd::Zero(p);
    for (std::size_t i = 0; i < problem_.blocks.size(); ++i) {
      const PhysicalBlock& block = problem_.blocks[i];
      if (block.kind == Unknown::kLink) {
        const Matrix4d& U = state_.U[i];
        Matrix10 ds;
        for (int k = 0; k < 10; ++k)
          ds.col(k) = to_vector(U * to_symmetric(Vector10::Unit(k)) * U.transpose());
        Av_.middleCols<10>(block.first) = problem_.A.middleCols<10>(block.first) * ds;
        slope_.segment<10>(block.first) = to_vector(U.transpose() * U);
      } else if (block.kind == Unknown::kPositive) {
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
    for (const PhysicalBlock& block : problem_.blocks) {
      if (block.kind == Unknown::kLink) {
        const Matrix4d inner = Matrix4d::Identity() + to_symmetric(v.segment<10>(block.first));
        const Eigen::LLT<Matrix4d> factor(inner);
        if (factor.info() != Eigen::Success) return false;
        for (int k = 0; k < 4; ++k) d -= 2.0 * std::log(factor.matrixLLT()(k, k));
        g.segment<10>(block.first) -= to_vector(factor.solve(Matrix4d::Identity()));
      } else if (block.kind == Unknown::kPositive) {
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
  bool move(const VectorXd& y, PhysicalState& state) const {
    const VectorXd v = M_ * y;
    PhysicalState moved = state_;
    for (std::size_t i = 0; i < problem_.blocks.size(); ++i) {
      const PhysicalBlock& block = problem_.blocks[i];
      double& number = moved.U[i](0, 0);
      if (block.kind == Unknown::kLink) {
        Matrix4d C;
        if (!to_upper(Matrix4d::Identity() + to_symmetric(v.segment<10>(block.first)), C)) return false;
        moved.U[i] = state_.U[i] * C;
      } else if (block.kind == Unknown::kPositive) {
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

  const PhysicalProblem& problem_;
  PhysicalState state_;
  double weight_;
  MatrixXd Av_;             ///< A ∂s/∂v
  VectorXd s_, r_, slope_;  ///< s and A s − z at the start; slope of the divergence without its logarithms
  MatrixXd M_;
};

}  // namespace

PhysicalState at_prior(const PhysicalProblem& problem) {
  PhysicalState state;
  for (const PhysicalBlock& block : problem.blocks) {
    state.U.emplace_back(Matrix4d::Identity());
    if (block.kind == Unknown::kFree) state.U.back()(0, 0) = 0.0;
  }
  return state;
}

VectorXd to_s(const PhysicalProblem& problem, const PhysicalState& state) {
  VectorXd s(problem.x0.size());
  for (std::size_t i = 0; i < problem.blocks.size(); ++i) {
    const PhysicalBlock& block = problem.blocks[i];
    if (block.kind == Unknown::kLink) {
      s.segment<10>(block.first) = to_vector(state.U[i] * state.U[i].transpose());
    } else {
      s[block.first] = state.U[i](0, 0);
    }
  }
  return s;
}

bool solve_stage(const PhysicalProblem& problem, double weight, double tolerance, int max_iterations,
                 PhysicalState& state, int& iterations) {
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

}  // namespace heft::identify
