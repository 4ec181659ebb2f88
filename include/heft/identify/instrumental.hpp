/// @file
/// Instrumental variables: estimates that noise in the measured motion does not bias, and a test whether it
/// does. Derivation: src/identify/instrumental.md
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/identify/fit.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

struct InstrumentOptions {
  Instruments kind{Instruments::kSimulated};
  /// kDelayed: how much earlier [s]; 0: 2.2 periods of the lower of the two cut-offs (motion, observation),
  /// where the autocorrelation of white position noise in the acceleration, filtered by both, is 0; beyond it
  /// stays below 0.08.
  double delay{0.0};
  /// kSimulated: low-pass on the measured position that the simulated arm follows [Hz]; 0: 2.5 times the
  /// motion's bandwidth, at most half the motion's cut-off. Noise in the acceleration grows with the fifth
  /// power of the cut-off (variance), so at a quarter of it a thousandth is left.
  double smoothing{0.0};
  /// Place of the log's reference position among MotionChunk::extra, followed instead of the measured position.
  /// kSimulated: where the log has it; kReference: a log without is refused. -1: there is none.
  int reference{-1};
  double control{0.0};    ///< kSimulated: natural frequency of the control [Hz]; 0: four times the smoothing
  double step{0.0};       ///< kSimulated: RK4 step [s]; 0: chosen from control and friction, 0.5 to 5 ms
  int max_iterations{5};  ///< kSimulated: simulate and fit, at most
  /// kSimulated: rest when the torque moves by less than this part of the noise (root mean square).
  double tolerance{0.02};
  /// Directions of the scaled, weighted base regressor whose singular value is below the largest over this
  /// stay at the start.
  double condition_limit{1000.0};
  double block{0.5};  ///< length of blocks at first [s]
  int max_blocks{96};
};

/// Sums of an instrumental variable fit by block of time and joint, and of the plain rows. Memory
/// is bounded as in BlockFactors.
class InstrumentSums {
 public:
  InstrumentSums(int joints, int columns, double block, int max_blocks = 96);

  /// Adds rows of one joint: time ascending, Z and W m × b, y m.
  void add(int log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
           const Eigen::Ref<const Eigen::MatrixXd>& Z, const Eigen::Ref<const Eigen::MatrixXd>& W,
           const Eigen::Ref<const Eigen::VectorXd>& y);

  int num_joints() const { return plain_.num_joints(); }
  int num_columns() const { return plain_.num_columns(); }
  /// The same rows as for plain least squares; blocks of equal number are the same stretch of time.
  const regression::BlockFactors& plain() const { return plain_; }
  int num_blocks() const { return static_cast<int>(blocks_.size()); }

  /// Zᵀ W (b × b) and Zᵀ y (b).
  struct Moments {
    Eigen::MatrixXd A;
    Eigen::VectorXd r;
  };
  /// Σ_j w_j of one block.
  Moments weighted(int block, const Eigen::VectorXd& weights) const;
  /// Σ_j w_j of all.
  Moments weighted(const Eigen::VectorXd& weights) const;

 private:
  void merge();

  regression::BlockFactors plain_;
  double length_;
  std::map<std::pair<int, long>, std::vector<Moments>> blocks_;  ///< by log and number, per joint
};

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
/// Cost: one pass over the logs for each iteration, and 0.02 ms for every RK4 step of a six-joint arm.
InstrumentalFit fit_instrumental(const regression::RegressionColumns& columns,
                                 const regression::BaseParameters& base,
                                 const std::vector<const data::MotionStream*>& logs,
                                 const regression::ObservationOptions& observation,
                                 const Eigen::VectorXd& start_beta, const Eigen::VectorXd& start_noise,
                                 const InstrumentOptions& options = {},
                                 const std::function<void(double)>& progress = {});

/// What became of simulated motion.
struct SimulationReport {
  int pieces{0};
  /// The model's mass matrix was not positive definite, or the motion ran away; the reference was used.
  int failed{0};
};

/// Instruments from simulation: the arm with parameters β under control along the smoothed measured position
/// (or the log's reference), by RK4 over each piece with its margins. See instrumental.md for the control.
/// @param report  counts up while the motion is used; may be null
regression::InstrumentMotion simulated_motion(const regression::RegressionColumns& columns,
                                              const regression::BaseParameters& base,
                                              const Eigen::VectorXd& beta,
                                              const std::vector<const data::MotionStream*>& logs,
                                              const InstrumentOptions& options = {},
                                              std::shared_ptr<SimulationReport> report = nullptr);

/// Instruments from the past: the motion `delay` earlier (whole samples). Before the log's first row: its
/// first row.
regression::InstrumentMotion delayed_motion(const std::vector<const data::MotionStream*>& logs,
                                            const regression::ObservationOptions& observation,
                                            const InstrumentOptions& options = {});

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
