/// @file
/// Least squares that allows for errors in the regressor as well as in the torque.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/regression/base_parameters.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

struct TotalLeastSquaresOptions {
  std::vector<bool> exact{};  ///< b: columns without error; empty: none
  /// b: standard deviation of the error of each column, relative to torque_noise; only the ratios count. Empty:
  /// equal relative noise, each column's error (and the torque's) is the same part of its rms over the rows.
  Eigen::VectorXd column_noise{};
  double torque_noise{1.0};  ///< of the (weighted) torque, in the units of column_noise; unused without those
  /// Directions whose singular value is not this much above the noise (the smallest singular value of all
  /// columns and the torque) are not determined.
  double min_separation{1.1};
};

struct TotalLeastSquaresFit {
  Eigen::VectorXd beta;  ///< b
  Eigen::VectorXd
      singular_values;  ///< of the noisy columns and the torque, each divided by its noise, largest first
  /// Error that was found, as standard deviation in units of the assumed one: with equal relative noise, the
  /// relative noise of every column and of the torque.
  double noise{0.0};
  /// Smallest singular value of the noisy columns alone over that with the torque; infinite without noise.
  double separation{0.0};
  /// The separation is above min_separation. Otherwise the problem has no generic solution: the directions
  /// below are left out (truncated total least squares, least norm in scaled columns), and beta must not be
  /// trusted there.
  bool separated{true};
  int left_out{0};  ///< directions left out
};

/// Mixed least squares and total least squares [1]: min ‖[E f]‖ with (W + E) β = y + f, E = 0 in exact
/// columns and the errors of the other columns and of the torque independent, from row to row too, with the
/// standard deviations of the options.
///
/// Exact columns are taken out by an orthogonal triangularisation; the right singular vector of the rest that
/// belongs to the smallest singular value gives β of the noisy columns, back substitution that of the exact
/// ones.
///
/// The assumption on the noise decides the result: where it is wrong, total least squares is biased like
/// plain least squares, only elsewhere. Errors of real motion are not independent between columns;
/// instruments (instrumental.hpp) need no such assumption.
///
/// [1] S. Van Huffel, J. Vandewalle, The Total Least Squares Problem, SIAM 1991, ch. 3.
///
/// @param data  rows already weighted, such that the errors of all rows are alike
/// @throws DataError when sizes differ or a noise is not positive.
/// Cost: O(b³).
TotalLeastSquaresFit total_least_squares(const regression::TriangularFactor& data,
                                         const TotalLeastSquaresOptions& options = {});

/// Total least squares over blocks of rows, with its covariance.
struct TotalLeastSquaresSpread {
  TotalLeastSquaresFit fit;
  Eigen::MatrixXd covariance;  ///< b × b; zero with fewer than two groups
  int groups{0};               ///< groups of blocks behind the covariance
};

/// The same with a delete-a-group jackknife: solved again without each group of blocks, (B − 1)/B Σ δ δᵀ. The
/// gradient of least squares does not vanish at this estimate, so the shortcut for least squares does not
/// hold.
/// @param weights      n, 1/σ²
/// @param length       blocks are joined to groups at least this long [s]; 0: as they are
/// @param edge_factor  on the covariance, for what neighbouring groups share
/// (ResidualStatistics::edge_factor)
/// Cost: O(B b³); half a second for 60 columns and 60 groups.
TotalLeastSquaresSpread total_least_squares(const regression::BlockFactors& factors,
                                            const Eigen::VectorXd& weights,
                                            const TotalLeastSquaresOptions& options = {}, double length = 0.0,
                                            double edge_factor = 1.0);

/// Columns that motion noise does not reach: the offsets. b.
std::vector<bool> exact_columns(const regression::RegressionColumns& columns,
                                const regression::BaseParameters& base);

}  // namespace heft::identify
