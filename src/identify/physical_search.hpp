/// @file
/// The search of the physical fit at one weight of the prior. Derivation: src/identify/physical.md
#pragma once

#include <vector>

#include <Eigen/Core>

#include "physical_problem.hpp"

namespace heft::identify {

/// State of the search: a factor U of each link's S = U Uᵀ, a positive number, or a free one. Links cannot
/// but be positive definite.
struct PhysicalState {
  std::vector<Eigen::Matrix4d> U;  ///< per block; (0, 0) holds the number of the others
};

PhysicalState at_prior(const PhysicalProblem& problem);

/// p: the unknowns s of a state.
Eigen::VectorXd to_s(const PhysicalProblem& problem, const PhysicalState& state);

/// Minimises ‖A s − z‖² + weight · divergence from the prior.
/// @param tolerance   on twice what is left to gain, over the weight
/// @param iterations  counts up; at most `max_iterations`
/// @return whether it converged; the state is moved in any case
bool solve_stage(const PhysicalProblem& problem, double weight, double tolerance, int max_iterations,
                 PhysicalState& state, int& iterations);

}  // namespace heft::identify
