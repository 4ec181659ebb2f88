/// @file
/// Instruments: a motion that goes with the true one but not with the noise in the measured one.
/// Derivation: src/identify/instrumental.md
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/identify/fit.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"

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
  /// kSimulated: end when the torque moves by less than this part of the noise (root mean square).
  double tolerance{0.02};
  /// Directions of the scaled, weighted base regressor whose singular value is below the largest over this
  /// stay at the start.
  double condition_limit{1000.0};
  double block{0.5};  ///< length of blocks at first [s]
  int max_blocks{96};
};

/// What became of simulated motion.
struct SimulationReport {
  std::atomic<int> pieces{0};
  /// The model's mass matrix was not positive definite, or the motion ran away; the reference was used.
  std::atomic<int> failed{0};
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

}  // namespace heft::identify
