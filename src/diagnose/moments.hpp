/// @file
/// Moments of base and candidate, and the fits that they give.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "problem.hpp"

namespace heft::diagnose {

/// Adds the moments of one joint in one block, (p_j + 1)², to those of all columns.
/// @param places  global columns of the joint's rows
void add_moments(const Eigen::MatrixXd& part, const std::vector<int>& places, double weight,
                 Eigen::MatrixXd& total);

/// Moments of a candidate's k columns over some blocks, weighted.
struct Added {
  Eigen::MatrixXd cross;   ///< p × k: with the base's columns
  Eigen::MatrixXd square;  ///< k × k
  Eigen::VectorXd torque;  ///< k
};
/// @param columns  p
Added nothing_added(int columns, int k);
/// Adds a candidate's moments in one block.
/// @param places  for each joint the global columns of its rows
/// @param noise   n: rms residual of each joint, by which its rows are weighted
void add_columns(const ColumnMoments& m, std::size_t block, const std::vector<std::vector<int>>& places,
                 const Eigen::VectorXd& noise, Added& sum);

/// Least weight of the prior: keeps directions that the motion does not show where the prior has them.
constexpr double kLeastSteady = 1e-8;

struct Solved {
  Eigen::VectorXd theta;
  Eigen::MatrixXd inverse;  ///< last columns of that of the steadied normal matrix
  double error;
};

/// Least squares from moments.
/// @param without  column to leave out; -1: none
/// @param steady   part of each column's squared norm that keeps it near 0
/// @param ridge    on top of `steady`, of the first columns, scaled as `steady` is
/// @param inverse  how many columns of the inverse are asked for, the last ones
Solved solve(const Eigen::MatrixXd& moments, int without, double steady, const Eigen::VectorXd& ridge,
             Eigen::Index inverse = 0);

/// Normal matrix of the base's columns, factored once for many candidates next to it.
struct Factored {
  Eigen::MatrixXd factor;  ///< p × p: L of D⁻¹ A D⁻¹ + steady I + ridge = L Lᵀ
  Eigen::VectorXd scale;   ///< p: diagonal of D, the columns' norms
  Eigen::VectorXd z;       ///< p: L⁻¹ D⁻¹ b
  double error{0.0};       ///< squared error of the base alone
};
/// @param moments, without, steady, ridge  see solve()
Factored factored(const Eigen::MatrixXd& moments, int without, double steady, const Eigen::VectorXd& ridge);
/// D⁻¹ L⁻ᵀ z: the fit of the base alone, p.
Eigen::VectorXd theta_of(const Factored& base);
/// solve() of base and candidate, p² operations for each of its columns where solve() takes p³/3. theta is p + k, and all
/// columns of the candidate are those of the inverse.
Solved solve_beside(const Factored& base, const Added& candidate, double steady);
/// Squared error of solve_beside().
double error_beside(const Factored& base, const Added& candidate, double steady);

/// Squared error of a solution in one block and joint, unweighted.
/// @param base  (p_j + 1)²
double squared_error(const Eigen::MatrixXd& base, const std::vector<int>& places, const Eigen::VectorXd& theta);

}  // namespace heft::diagnose
