/// @file
/// Moments of base and candidate together, and the fits that they give.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "problem.hpp"

namespace heft::diagnose {

/// Adds the moments of one joint in one block, (p_j + 1)², to those of all columns.
/// @param places  global columns of the joint's rows
void add_moments(const Eigen::MatrixXd& part, const std::vector<int>& places, double weight,
                 Eigen::MatrixXd& total);

/// Adds a candidate's moments in one block to the (p + k + 1)² moments of base and candidate.
/// @param places   for each joint the global columns of its rows
/// @param noise    n: rms residual of each joint, by which its rows are weighted
/// @param columns  p
void add_columns(const ColumnMoments& m, std::size_t block, const std::vector<std::vector<int>>& places,
                 const Eigen::VectorXd& noise, int columns, Eigen::MatrixXd& total);

/// (p + 1)² moments with room for k more columns before the torque's.
Eigen::MatrixXd widened(const Eigen::MatrixXd& base, int k);

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

/// Squared error of a solution in one block and joint, unweighted.
/// @param m  of a candidate whose coefficients follow the base's `columns`; may be null
double squared_error(const Eigen::MatrixXd& base, const std::vector<int>& places,
                     const Eigen::VectorXd& theta, const ColumnMoments* m, std::size_t block,
                     int place_of_joint, int columns);

}  // namespace heft::diagnose
