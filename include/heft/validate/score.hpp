/// @file
/// How well a model predicts the torque of a log.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/predict.hpp"
#include "heft/validate/scored_time.hpp"

namespace heft::validate {

/// Measured minus predicted torque of one log, or of several taken together. Vectors of n.
///
/// "rmse" is against the torque as logged, unfiltered, at the log's own time stamps: all samples but the first
/// and last 0.5 s and those within 0.5 s of a gap (ScoredTime), reversals and standstill included. "in band": both
/// sides through the same zero-phase low-pass on the even grid.
struct Score {
  std::string log;           ///< path; empty for a pooled score
  long samples{0};           ///< counted in rmse
  bool ends_left_out{true};  ///< false: the log is too short for it, all samples count
  double band{0.0};          ///< of the low-pass [Hz]; 0: none, the log is too short or too slow for it

  Eigen::VectorXd rmse;            ///< [N·m, N]
  Eigen::VectorXd rmse_in_band;    ///< [N·m, N]; NaN without a band
  Eigen::VectorXd percent_of_max;  ///< rmse against max_torque
  /// The two errors over the samples between standstill at the begin and at the end alone; NaN without one.
  Eigen::VectorXd rmse_moving, rmse_in_band_moving;
  long samples_moving{0};  ///< counted in rmse_moving
  Eigen::VectorXd in_band_percent_of_max;
  Eigen::VectorXd r2;            ///< 1 − residual power / variance of the measured torque
  Eigen::VectorXd quantile_999;  ///< |residual| that 99.9 % of the samples stay below [N·m, N]
  Eigen::VectorXd bias;          ///< mean residual [N·m, N]
  Eigen::VectorXd max_torque;    ///< largest |τ| in the log [N·m, N]
  Eigen::VectorXd torque_mean, torque_variance;  ///< of the measured torque, same samples as rmse

  // Whiteness, from the power spectral density of the residual about its mean.
  /// Share of the residual's variance that is correlated in time: what exceeds the level of its upper half
  /// of frequencies. White noise has none; what a model misses is nothing else. NaN: too few samples.
  Eigen::VectorXd correlated_share;
  /// Nine tenths of the correlated part lie below this frequency [Hz]; NaN without one.
  Eigen::VectorXd correlated_below;
  /// Time that is worth one independent sample: period · (1 + 2 Σ ρ), summed while ρ > 0.05 [s].
  Eigen::VectorXd correlation_time;
  double sample_rate{0.0};  ///< of the even grid [Hz]

  int num_joints() const { return static_cast<int>(rmse.size()); }
};

/// Correlated share up to which a residual counts as white: the scatter of the estimate on logs of some seconds.
inline constexpr double kWhiteShare = 0.1;

/// One sentence about a joint's residual: noise, or something that the model misses and where it sits.
std::string describe_residual(const Score& score, int joint);

/// The scores of several logs as one: errors weighted by samples, percentages against the largest torque of all.
/// Quantile: the largest; whiteness and band: those of the longest log.
/// @pre at least one score, same number of joints
Score pool(const std::vector<Score>& scores);

/// Collects a score while torque and prediction come in, in bounded memory.
class TorqueScorer {
 public:
  struct Setup {
    std::string log;
    double begin{0.0}, end{0.0};  ///< first and last time stamp [s]
    long samples{0};              ///< rows to come
    Eigen::VectorXd max_torque;   ///< n
    double sample_rate{0.0};      ///< of the even grid [Hz]
    double band{0.0};             ///< low-pass for the figures in band [Hz]; not below half the rate: none
    std::vector<data::TimeGap> gaps;  ///< rows in and beside them count nowhere, see ScoredTime
    /// Standstill outside of it [s].
    double moving_from{-std::numeric_limits<double>::infinity()};
    double moving_to{std::numeric_limits<double>::infinity()};
  };
  explicit TorqueScorer(const Setup& setup);
  ~TorqueScorer();
  TorqueScorer(TorqueScorer&&) noexcept;
  TorqueScorer& operator=(TorqueScorer&&) noexcept;

  /// Rows of the log, in time order.
  /// @param measured, predicted  m × n
  void add_rows(const Eigen::Ref<const Eigen::VectorXd>& time,
                const Eigen::Ref<const Eigen::MatrixXd>& measured,
                const Eigen::Ref<const Eigen::MatrixXd>& predicted);
  /// Residual on the even grid, in time order without overlap.
  void add_grid(const Eigen::Ref<const Eigen::VectorXd>& time,
                const Eigen::Ref<const Eigen::MatrixXd>& residual);
  Score finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Cut-off of the figures in band when none is asked for: five times the motion's bandwidth, at least 1 Hz.
double default_band(double motion_bandwidth);

struct ScoreOptions {
  double band{0.0};  ///< low-pass for the figures in band [Hz]; 0: default_band
  /// Width of the friction's sign [rad/s, m/s], so that a joint that rests with a noisy velocity has none.
  double sign_width{kSignWidth};
  /// Gets the rows of each piece with their prediction, for plots; may be empty.
  std::function<void(const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                     const Eigen::MatrixXd& predicted)>
      rows{};
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// Judges a robot's joint torque, with everything that model::MotionTorque knows (gear couplings, effects, elastic
/// joints, delay), on a log. One pass, memory of one piece.
/// @param robot  what its drives add must be what the torque of the log holds: see model::as_measured()
/// @throws DataError when the log has another number of joints or no torque.
Score score(const model::Robot& robot, const data::MotionStream& log, const ScoreOptions& options = {});

/// Errors on the training logs into what a model file keeps of a fit.
void put_training(const Score& training, model::FitRecord& record);

/// Scores a prediction that is there already, at the log's own time stamps.
/// @param predicted  samples × joints [N·m, N]
/// @param band       low-pass for the figures in band [Hz]; 0: default_band of the motion
/// @pre log.tau has as many columns as `predicted`
Score score(const data::Log& log, const Eigen::MatrixXd& predicted, double band = 0.0);

}  // namespace heft::validate
