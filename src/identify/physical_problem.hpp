/// @file
/// Least squares over physically possible links, in units of the prior. Derivation: src/identify/physical.md
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/regression/base_parameters.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

using Vector10 = Eigen::Matrix<double, 10, 1>;

/// Symmetric matrix to ten numbers with the same inner product.
Vector10 to_vector(const Eigen::Matrix4d& S);
Eigen::Matrix4d to_symmetric(const Eigen::Ref<const Vector10>& s);

/// How an unknown enters: ten of a link, one that stays positive, one that is free.
enum class Unknown { kLink, kPositive, kFree };

struct PhysicalBlock {
  Unknown kind;
  int first;  ///< of its unknowns, and of its columns
  int size;
  int link{-1};
};

/// The problem in units of the prior. A link is P = L (ε E + (1 − ε) S) Lᵀ with P₀ = L Lᵀ, a positive number
/// y₀ s, a free one y₀ + c s. All stacked, x = x₀ + T s, and the data say ‖A s − z‖².
struct PhysicalProblem {
  std::vector<PhysicalBlock> blocks;
  Eigen::VectorXd x0;
  Eigen::MatrixXd T;  ///< p × p, block diagonal
  Eigen::MatrixXd A;  ///< b × p
  Eigen::VectorXd z;
  double degree{0.0};  ///< of the barrier: 4 a link, 1 a positive number
};

/// Links whose prior could not be used as it was, from 1.
struct PriorChanges {
  std::vector<int> repaired;  ///< made physically possible
  std::vector<int> rescaled;  ///< more than tenfold too light; its size comes from the data
};

/// @param prior   p
/// @param margin  least distance from the boundary, in parts of the prior
PhysicalProblem make_problem(const regression::RegressionColumns& columns,
                             const regression::BaseParameters& base, const regression::TriangularFactor& data,
                             const Eigen::VectorXd& prior, double margin, PriorChanges& changes);

/// The part of a problem that is about some of its columns, without data (A, z are empty); the others stay as they are.
/// @param columns  ascending, all ten of a link or none
PhysicalProblem part_of(const PhysicalProblem& whole, const std::vector<int>& columns);

}  // namespace heft::identify
