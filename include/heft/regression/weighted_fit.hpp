/// @file
/// Weighted least squares with a ridge where the rows need one, and its covariance: the fit that identify writes, and
/// that diagnose measures what it finds against. Derivation: src/identify/fit.md
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::regression {

/// A least squares problem in columns of norm 1, steadied by a ridge where asked for.
struct Solution {
  Eigen::VectorXd beta;   ///< b
  Eigen::VectorXd scale;  ///< b: norms of the columns
  double condition{0.0};  ///< of the scaled columns
  double ridge{0.0};      ///< added to the scaled information
  /// How much of each parameter comes from the rows, 0..1: diagonal of V diag(σ²/(σ² + λ)) Vᵀ.
  Eigen::VectorXd resolution;
};

/// Condition number of the weighted rows, columns scaled to norm 1, from which on a ridge steadies a fit: what is
/// known worse than that is noise.
inline constexpr double kRidgeFromCondition = 1000.0;

/// β = argmin ‖R β − z‖² + λ ‖S (β − β₀)‖², S the column norms. λ = 0 unless the condition number passes the
/// limit; then λ = (σ_max/limit)², with which the steadied problem has about that condition number.
/// @param prior       b: β₀
/// @param ridge_from  the limit; 0: never a ridge
Solution solve(const regression::TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from);

/// β of solve(), arguments as there; where the limit is surely kept, without its singular values, for one inverse of a triangle.
Eigen::VectorXd estimate(const TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from);

/// n: scatter of every joint's residual; degrees of freedom are shared among joints by their rows.
/// @param joints  n: the rows of each
Eigen::VectorXd noise_of(const std::vector<TriangularFactor>& joints, const Eigen::VectorXd& beta);

/// n: 1/σ². A residual of nothing but rounding must not make a weight of infinity.
Eigen::VectorXd weights_of(const Eigen::VectorXd& noise);

/// Rows, the weights of their joints and the estimate that these give.
struct WeightedFit {
  BlockFactors factors;
  std::vector<TriangularFactor> joints;  ///< n: the rows of each joint, merged once
  Eigen::VectorXd weights;               ///< n, 1/σ²; at first 1
  Solution solution;

  explicit WeightedFit(BlockFactors rows)
      : factors(std::move(rows)), joints(factors.joints()), weights(Eigen::VectorXd::Ones(factors.num_joints())) {}

  /// All rows with these weights.
  TriangularFactor rows() const { return weighted(joints, weights); }
  /// n: scatter of every joint's residual at the estimate.
  Eigen::VectorXd noise() const { return noise_of(joints, solution.beta); }
  /// The estimate of these rows with these weights.
  void solve_for(const Eigen::VectorXd& prior, double ridge_from) { solution = solve(rows(), prior, ridge_from); }
};

/// Reads the logs once: the triangle of every joint and half second.
/// @param keys    numbers that the logs go by in the blocks; empty: their places
/// @param record  gets all rows; may be null
BlockFactors compressed(const RegressionColumns& columns, const BaseParameters& base,
                        const std::vector<const data::MotionStream*>& logs,
                        const ObservationOptions& observation, const std::vector<long>& keys = {},
                        RecordedRows* record = nullptr);

/// How long the residual of an estimate is correlated in time, n [s], from the rows recorded before, or from the logs once more
/// where the record has none.
/// @param beta  b
Eigen::VectorXd residual_correlation(const RegressionColumns& columns, const BaseParameters& base,
                                     const std::vector<const data::MotionStream*>& logs,
                                     const ObservationOptions& observation, const Eigen::VectorXd& beta,
                                     const RecordedRows& record);

/// Solves with weights from the scatter that the fit before leaves, until they converge; cost does not depend on the
/// length of the logs.
/// @param weighed     false: every joint's rows count alike
void weigh_joints(const Eigen::VectorXd& prior, double ridge_from, bool weighed, WeightedFit& fit);

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

}  // namespace heft::regression
