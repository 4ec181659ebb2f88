/// @file
/// Weighted least squares with a ridge where the rows need one, and its covariance. Derivation: src/identify/fit.md
#pragma once

#include <Eigen/Core>

#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

/// A least squares problem in columns of norm 1, steadied by a ridge where asked for.
struct Solution {
  Eigen::VectorXd beta;   ///< b
  Eigen::VectorXd scale;  ///< b: norms of the columns
  double condition{0.0};  ///< of the scaled columns
  double ridge{0.0};      ///< added to the scaled information
  /// How much of each parameter comes from the rows, 0..1: diagonal of V diag(σ²/(σ² + λ)) Vᵀ.
  Eigen::VectorXd resolution;
};

/// β = argmin ‖R β − z‖² + λ ‖S (β − β₀)‖², S the column norms. λ = 0 unless the condition number passes the
/// limit; then λ = (σ_max/limit)², with which the steadied problem has about that condition number.
/// @param prior       b: β₀
/// @param ridge_from  the limit; 0: never a ridge
Solution solve(const regression::TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from);

/// n: scatter of every joint's residual; degrees of freedom are shared among joints by their rows.
Eigen::VectorXd noise_of(const regression::BlockFactors& factors, const Eigen::VectorXd& beta);

/// n: 1/σ². A residual of nothing but rounding must not make a weight of infinity.
Eigen::VectorXd weights_of(const Eigen::VectorXd& noise);

struct Spread {
  Eigen::MatrixXd covariance;  ///< b × b
  int blocks{0};               ///< behind it
};

/// Delete-a-block covariance of a weighted least squares estimate.
/// @param weights      n, 1/σ²
/// @param length       blocks are joined to at least this [s]
/// @param edge_factor  on the covariance, for what neighbours share (ResidualStatistics::edge_factor)
Spread spread_of(const regression::BlockFactors& factors, const Eigen::VectorXd& weights,
                 const Solution& solution, double length, double edge_factor);

}  // namespace heft::identify
