/// @file
/// Does noise in the measured motion bias plain least squares? Derivation: src/identify/instrumental.md
#pragma once

#include <Eigen/Core>

#include "heft/identify/fit.hpp"
#include "instrument_sums.hpp"

namespace heft::identify {

/// Durbin-Wu-Hausman: whether plain least squares and instruments disagree by more than chance.
///
/// In coordinates u in which the weighted rows are orthonormal, d = u_IV − u_LS, its covariance from the
/// jackknife of the difference itself over groups of blocks (so whatever the correlation in time and between
/// the two). Tested is the part of d in the k directions in which noise of the motion would move least
/// squares most (see instrumental.md); k is at most a fifth of the number of groups. T² = d'ᵀ V'⁻¹ d',
/// p-value from F(k, B − k) = T² (B − k)/(k (B − 1)) for B groups.
///
/// `biased`: p < 0.01 and torque_difference > 0.1. No verdict with fewer than 10 groups, or where chance
/// alone would put the two estimates further apart than half of the residual.
/// @param sums, weights, length, edge_factor  as for solve_instrumental
BiasTest test_bias(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit = 1000.0, double length = 0.0, double edge_factor = 1.0);

}  // namespace heft::identify
