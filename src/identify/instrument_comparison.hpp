/// @file
/// The estimates with and without instruments in coordinates in which the rows are orthonormal, each again without
/// every group of blocks: what covariance and test for bias are made of. Derivation: src/identify/instrumental.md
#pragma once

#include <Eigen/Core>

#include "instrument_sums.hpp"

namespace heft::identify {

/// Coordinates in which the determined directions of the weighted rows are orthonormal: β = start + T u.
struct Frame {
  Eigen::MatrixXd T;        ///< b × k
  Eigen::MatrixXd from;     ///< k × b: u of β, Tᵀ WᵀW
  Eigen::VectorXd u_plain;  ///< k: least squares
  int left_out{0};
  double residual{0.0};  ///< ‖√w (y − W β_LS)‖²
};

/// Everything of the two estimates in the frame: at the estimate, and without each group.
struct Comparison {
  Frame frame;
  Eigen::MatrixXd K;        ///< Tᵀ ZᵀW T, k × k; the identity if instruments were the motion itself
  Eigen::VectorXd u;        ///< k: instrumental
  Eigen::MatrixXd without;  ///< k × B: u without group g, minus u
  Eigen::MatrixXd plain_without;  ///< the same for least squares
  double relevance{0.0};          ///< smallest singular value of K
  double relevance_ratio{0.0};    ///< over its standard deviation
};

/// @param weights          n, 1/σ²
/// @param start            b: where undetermined directions stay
/// @param condition_limit  directions whose singular value is below the largest over this are left out
/// @param length           blocks are joined to groups at least this long [s]; 0: as they are
/// @param with_plain       fill `plain_without`
Comparison compare(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit, double length, bool with_plain);

}  // namespace heft::identify
