#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "engine.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A number of an effect that the model is not linear in.
struct Knob {
  std::size_t effect;
  double Candidate::*value;
  bool ratio;    ///< steps are those of its logarithm
  double probe;  ///< step that the slope is found with
  double most;   ///< longest step
};

std::vector<Knob> knobs_of(const std::vector<Candidate>& accepted) {
  std::vector<Knob> knobs;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    if (accepted[e].is_elastic()) {
      knobs.push_back({e, &Candidate::shape, true, 0.005, 0.1});
      knobs.push_back({e, &Candidate::second, true, 0.1, 0.7});
    } else if (accepted[e].effect.is<Delay>()) {
      knobs.push_back({e, &Candidate::shape, false, 1e-4, 1e-3});
    }
  }
  return knobs;
}

/// What knobs turn, and what it goes with.
struct Shape {
  double shape, second, inertia;
};

std::vector<Shape> shapes_of(const std::vector<Candidate>& accepted) {
  std::vector<Shape> shapes;
  for (const Candidate& e : accepted) shapes.push_back({e.shape, e.second, e.inertia});
  return shapes;
}

/// Turns knobs away from where they stand.
void turn(const std::vector<Knob>& knobs, const std::vector<Shape>& from, const VectorXd& steps,
          std::vector<Candidate>& accepted) {
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    accepted[e].shape = from[e].shape;
    accepted[e].second = from[e].second;
    accepted[e].inertia = from[e].inertia;
  }
  for (std::size_t k = 0; k < knobs.size(); ++k) {
    const double step = steps[static_cast<Index>(k)];
    double& value = accepted[knobs[k].effect].*knobs[k].value;
    value = knobs[k].ratio ? value * std::exp(step) : value + step;
  }
}

/// Steps no longer than what the slopes may be trusted for.
/// @param reach  part of Knob::most
VectorXd within_reach(VectorXd steps, const std::vector<Knob>& knobs, double reach) {
  for (Index k = 0; k < steps.size(); ++k) {
    const double most = reach * knobs[static_cast<std::size_t>(k)].most;
    steps[k] = std::clamp(steps[k], -most, most);
  }
  return steps;
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
/// @param slopes  of the residual, one a knob
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
  normal.diagonal() *= 1.001;  // knobs that do the same
  return normal.ldlt().solve(right);
}

}  // namespace

void Engine::tune() {
  const std::vector<Knob> knobs = knobs_of(accepted);
  if (knobs.empty()) return;
  const VectorXd nowhere = VectorXd::Zero(static_cast<Index>(knobs.size()));
  constexpr int kSteps = 10, kShorter = 3;
  constexpr double kWorthAStep = 10.0;  // of the sum: less is chance
  double reach = 1.0;
  for (int step = 0; step < kSteps; ++step) {
    const std::vector<Shape> here = shapes_of(accepted);
    begin_near(*this, 1);
    // What every trial begins with: their residuals differ by what the masses still move otherwise.
    std::optional<Nearby> begin = std::exchange(nearby_, {});
    const auto residual_at = [&](const VectorXd& steps) {
      turn(knobs, here, steps, accepted);
      nearby_ = begin;
      build();
      return problem_->residual();
    };
    const MatrixXd residual = residual_at(nowhere);
    const double least = left(problem_->counted(), residual);
    if (!std::isfinite(least)) break;
    std::vector<MatrixXd> slopes;
    for (std::size_t k = 0; k < knobs.size(); ++k) {
      VectorXd probe = nowhere;
      probe[static_cast<Index>(k)] = knobs[k].probe;
      slopes.push_back((residual_at(probe) - residual) / knobs[k].probe);
    }
    const VectorXd wanted = step_of(slopes, problem_->counted(), residual);
    double now = std::numeric_limits<double>::infinity();
    for (int k = 0; k < kShorter && wanted.allFinite() && !(now < least); ++k) {
      now = left(problem_->counted(), residual_at(within_reach(wanted, knobs, reach)));
      reach = now < least ? std::min(1.0, 2.0 * reach) : 0.35 * reach;
    }
    if (!(now < least)) {
      turn(knobs, here, nowhere, accepted);
      if (begin) begin->fits = 2;
      nearby_ = std::move(begin);
      break;
    }
    if (least - now < kWorthAStep) break;
  }
  build();
}

}  // namespace heft::diagnose
