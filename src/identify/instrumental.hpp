/// @file
/// Instrumental variables: estimates that noise in the measured motion does not bias.
/// Derivation: src/identify/instrumental.md
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "instrument_sums.hpp"
#include "instruments.hpp"

namespace heft::identify {

/// β = (Σ w_j Z_jᵀ W_j)⁻¹ Σ w_j Z_jᵀ y_j in the directions that the rows determine.
struct InstrumentalEstimate {
  Eigen::VectorXd beta;        ///< b
  Eigen::MatrixXd covariance;  ///< b × b, delete-a-group jackknife; 0 along directions left at the start
  int groups{0};               ///< groups of blocks behind the covariance
  int left_out{0};             ///< directions left at the start
  /// How much of the (noisy) motion the instruments show in the direction where they do least: smallest
  /// singular value of ZᵀW in coordinates in which WᵀW is the identity. 1: all of it.
  double relevance{0.0};
  /// The same over its standard deviation, from the scatter between groups; below 4 the instruments are weak,
  /// and neither the estimate nor its covariance can be trusted in that direction.
  double relevance_ratio{0.0};
};

/// @param weights      n, 1/σ²
/// @param start        b: where undetermined directions stay
/// @param length       blocks are joined to groups at least this long [s]; 0: as they are
/// @param edge_factor  on the covariance, for what neighbours share (ResidualStatistics::edge_factor)
InstrumentalEstimate solve_instrumental(const InstrumentSums& sums, const Eigen::VectorXd& weights,
                                        const Eigen::VectorXd& start, double condition_limit = 1000.0,
                                        double length = 0.0, double edge_factor = 1.0);

struct InstrumentalFit {
  InstrumentalEstimate estimate;  ///< blocks as they are; solve_instrumental on `sums` for others
  InstrumentSums sums;            ///< of the last iteration
  Eigen::VectorXd noise_std;      ///< n: scatter of the residual at this β [N·m, N]
  int iterations{0};
  bool converged{false};
  std::vector<std::string> notes;  ///< weak instruments, pieces that could not be simulated
};

/// Fits with instruments [1], [2].
///
/// kSimulated: fit, simulate, fit, ...; the first simulation uses `start_beta`. kDelayed: one pass.
/// Weights are 1/start_noise² throughout, so that the estimate can be compared with plain least squares.
///
/// [1] A. Janot, P.-O. Vandanjon, M. Gautier, A generic instrumental variable approach for industrial robot
///     identification, IEEE Trans. Control Systems Technology 22 (2014).
/// [2] L. Ljung, System Identification: Theory for the User, 2nd ed., 1999, section 7.6.
///
/// @param start_beta   b: plain (weighted) least squares
/// @param start_noise  n
/// @param progress     called with 0..1; may be empty
/// @param plain        sums of the plain rows where they are known; to stay as long as the result
/// @param recorded     rows of the same logs, as for_each_observation() takes them
/// Cost: one pass over the logs for each iteration, and 0.02 ms for every RK4 step of a six-joint arm.
InstrumentalFit fit_instrumental(const regression::RegressionColumns& columns,
                                 const regression::BaseParameters& base,
                                 const std::vector<const data::MotionStream*>& logs,
                                 const regression::ObservationOptions& observation,
                                 const Eigen::VectorXd& start_beta, const Eigen::VectorXd& start_noise,
                                 const InstrumentOptions& options = {},
                                 const std::function<void(double)>& progress = {},
                                 const regression::RecordedRows* recorded = nullptr,
                                 const regression::BlockFactors* plain = nullptr);

}  // namespace heft::identify
