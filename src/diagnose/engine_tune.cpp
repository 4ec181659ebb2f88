#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "arm_search.hpp"
#include "engine.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Delays among the effects.
std::vector<std::size_t> delays_of(const std::vector<Candidate>& accepted) {
  std::vector<std::size_t> delays;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    if (accepted[e].effect.is<Delay>()) delays.push_back(e);
  }
  return delays;
}

/// What tuning and fits change.
struct Shape {
  double shape, second, inertia;
};

std::vector<Shape> shapes_of(const std::vector<Candidate>& accepted) {
  std::vector<Shape> shapes;
  for (const Candidate& e : accepted) shapes.push_back({e.shape, e.second, e.inertia});
  return shapes;
}

/// Delays by some steps away from where they stood, springs as they were there.
/// @param steps  [s]
void shift(const std::vector<std::size_t>& delays, const std::vector<Shape>& from, const VectorXd& steps,
           std::vector<Candidate>& accepted) {
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    accepted[e].shape = from[e].shape;
    accepted[e].second = from[e].second;
    accepted[e].inertia = from[e].inertia;
  }
  for (std::size_t k = 0; k < delays.size(); ++k) accepted[delays[k]].shape += steps[static_cast<Index>(k)];
}

/// What is left, with each joint by its own noise: Σ rows ln(squared error).
double left(const VectorXd& counted, const MatrixXd& residual) {
  if (!residual.allFinite()) return std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (Index j = 0; j < residual.cols(); ++j) {
    sum += counted[j] * std::log(std::max(1e-300, residual.col(j).squaredNorm()));
  }
  return sum;
}

/// Gauss-Newton step: (Σ wj Sj' Sj) p = -Σ wj Sj' rj with wj = rows / rj' rj.
/// @param slopes  of the residual, one a delay
VectorXd step_of(const std::vector<MatrixXd>& slopes, const VectorXd& counted, const MatrixXd& residual) {
  const auto count = static_cast<Index>(slopes.size());
  const VectorXd weight = counted.cwiseQuotient(residual.colwise().squaredNorm().transpose().cwiseMax(1e-300));
  MatrixXd normal(count, count);
  VectorXd right(count);
  for (Index a = 0; a < count; ++a) {
    const MatrixXd weighted = slopes[static_cast<std::size_t>(a)] * weight.asDiagonal();
    for (Index b = 0; b < count; ++b) normal(a, b) = weighted.cwiseProduct(slopes[static_cast<std::size_t>(b)]).sum();
    right[a] = -weighted.cwiseProduct(residual).sum();
  }
  normal.diagonal() *= 1.001;  // delays that do the same
  return normal.ldlt().solve(right);
}

}  // namespace

/// Passes of deflection and fit until the springs stand still.
void Engine::settle_springs() {
  constexpr int kPasses = 12;
  constexpr double kStill = 1e-3;  // of the logarithm
  for (int pass = 0; pass < kPasses; ++pass) {
    begin_near(*this, 1);
    if (!nearby_) return;
    build();
    if (spring_step_ < kStill) return;
  }
}

double Engine::mean_log_error() const {
  return left(problem_->counted(), problem_->residual()) / std::max(1.0, problem_->counted().sum());
}

void Engine::tune() {
  settle_springs();
  const std::vector<std::size_t> delays = delays_of(accepted);
  // What a delay leaves out goes by the delay that it had; a longer one shows changes of direction later.
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds && !delays.empty(); ++round) {
    tune_delays(delays);
    bool enough = true;
    for (const std::size_t e : delays) {
      const double reach = delay_reach(accepted[e].shape);
      enough = enough && !(reach > 1.1 * accepted[e].second);
      accepted[e].second = std::max(accepted[e].second, reach);
    }
    if (enough) return;
    build();
  }
}

void Engine::tune_delays(const std::vector<std::size_t>& delays) {
  const auto count = static_cast<Index>(delays.size());
  constexpr int kSteps = 10, kShorter = 3;
  constexpr double kProbe = 1e-4, kMost = 1e-3;  // [s]
  constexpr double kWorthAStep = 10.0;           // of the sum: less is chance
  constexpr double kLongest = 8.0;               // of a step that slopes ask for
  double reach = 1.0;
  for (int step = 0; step < kSteps; ++step) {
    const std::vector<Shape> here = shapes_of(accepted);
    begin_near(*this, 1);
    // What every trial begins with: their residuals differ by what the masses still move otherwise.
    std::optional<Nearby> begin = std::exchange(nearby_, {});
    const auto residual_at = [&](const VectorXd& steps) {
      shift(delays, here, steps, accepted);
      nearby_ = begin;
      build();
      return problem_->residual();
    };
    const MatrixXd residual = residual_at(VectorXd::Zero(count));
    const double least = left(problem_->counted(), residual);
    if (!std::isfinite(least)) break;
    std::vector<MatrixXd> slopes;
    for (Index k = 0; k < count; ++k)
      slopes.push_back((residual_at(kProbe * VectorXd::Unit(count, k)) - residual) / kProbe);
    const VectorXd wanted = step_of(slopes, problem_->counted(), residual);
    double now = std::numeric_limits<double>::infinity();
    // Noise of the motion makes slopes steeper than what is left is, and steps too short: they grow while they succeed.
    for (int k = 0; k < kShorter && wanted.allFinite() && !(now < least); ++k) {
      const double most = kMost * std::min(1.0, reach);
      now = left(problem_->counted(), residual_at((std::max(1.0, reach) * wanted).cwiseMax(-most).cwiseMin(most)));
      reach = now < least ? std::min(kLongest, 2.0 * reach) : 0.35 * reach;
    }
    if (!(now < least)) {
      shift(delays, here, VectorXd::Zero(count), accepted);
      if (begin) begin->fits = 2;
      nearby_ = std::move(begin);
      break;
    }
    if (least - now < kWorthAStep) break;
  }
  build();
}

}  // namespace heft::diagnose
