/// @file
/// Weighted least squares in which outliers count less.
/// Derivation: src/identify/robust.md
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

/// One pass over all rows, in the same order every time: calls its argument for every piece.
using ObservationPass = std::function<void(const std::function<void(const regression::ObservationRows&)>&)>;

struct RobustOptions {
  // Residuals in scales; both are 95 % efficient for normal noise.
  double huber{1.345};  ///< from here on Huber's weight falls
  double tukey{4.685};  ///< from here on Tukey's weight is 0
  int max_huber{30};    ///< iterations with Huber's weights, which lead to one minimum from any start
  int max_tukey{30};    ///< iterations with Tukey's weights from there; 0: stay with Huber
  /// The iterations end when the torque that the step moves is below this share of the scale (root mean
  /// square over the rows), and with Huber's weights no scale changes by more than ten times this share.
  double tolerance{1e-3};
  double block{0.5};  ///< length of the blocks of the factors at first [s]
  int max_blocks{96};
  /// Rows are kept from the first pass on while they need less memory than this [bytes]; beyond, every
  /// iteration reads the logs again.
  std::size_t row_memory{std::size_t{64} << 20U};
  /// Solves the weighted problem; empty: least squares, directions that the rows do not determine stay at the
  /// start.
  std::function<Eigen::VectorXd(const regression::TriangularFactor&)> solve{};
};

struct RobustFit {
  Eigen::VectorXd beta;  ///< b
  /// n: scale of the residual, 1.4826 · median |r| [N·m, N]; as start_noise for a joint without rows.
  Eigen::VectorXd noise_std;
  /// Reweighted rows, not yet weighted by joint. Their weighted least squares solution (weights 1/noise_std²)
  /// is beta, and their jackknife over blocks gives its covariance to first order; see robust.md,
  /// "covariance". The squared error of these factors is not that of the rows.
  regression::BlockFactors factors;
  /// n: part of the rows whose weight is below one half (1.1 % for normal noise).
  Eigen::VectorXd downweighted_share;
  int iterations{0};
  bool converged{false};
};

/// Iteratively reweighted least squares: Huber's weights until they converge, then Tukey's biweight from there.
///
///   u = r / s_j,  Huber  w = min(1, c/|u|),  Tukey  w = (1 − (u/c)²)² inside |u| < c, 0 outside;
///   s_j = 1.4826 · median |r| of joint j, computed again in every iteration of Huber's, kept with Tukey's.
///
/// √w goes on the row and its torque before the row enters the factor. The median comes from a histogram of
/// log |r| (256 bins an octave), so memory does not depend on the number of rows beyond `row_memory`.
///
/// Outliers of torque are bounded in what they do to the estimate; rows whose regressor is wrong (leverage)
/// are not. Note that a low-pass on the torque spreads a single wrong sample over its neighbours.
///
/// @param start_beta   b: for instance plain weighted least squares
/// @param start_noise  n: only used for joints without rows, and for the range of the histogram
/// @throws DataError when sizes differ.
/// Cost: one pass over the logs, O(rows b²) for each iteration; usually 8 to 15 iterations.
RobustFit fit_robust(const ObservationPass& pass, const Eigen::VectorXd& start_beta,
                     const Eigen::VectorXd& start_noise, const RobustOptions& options = {});

/// The same with rows from logs.
/// @param progress  called with 0..1; may be empty
RobustFit fit_robust(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                     const std::vector<const data::MotionStream*>& logs,
                     const regression::ObservationOptions& observation, const Eigen::VectorXd& start_beta,
                     const Eigen::VectorXd& start_noise, const RobustOptions& options = {},
                     const std::function<void(double)>& progress = {});

}  // namespace heft::identify
