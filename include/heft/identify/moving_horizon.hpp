/// @file
/// What are the parameters just now? Friction that drifts and the inertia of chosen links, estimated while the arm moves
/// from a window of the last seconds; physically possible in every step.
/// Derivation: src/identify/moving_horizon.md
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/numbers.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::identify {

/// Settings of a MovingHorizon.
struct HorizonOptions {
  /// Links whose ten parameters are unknown, from 0; empty: the last one.
  std::vector<int> links{};
  bool coulomb{true};  ///< Coulomb friction of every joint is unknown; else as in the robot
  bool viscous{true};  ///< viscous friction, likewise
  bool offset{false};  ///< friction offset, likewise; the only unknown that may be negative
  double window{3.0};  ///< length of the window, 0.5 to 60 [s]
  double period{0.1};  ///< between two steps, 0.01 to `window` / 2 [s]
  /// Poles of the filter that motion and torque pass, see StateVariableFilter, 0.1 to 1000 [Hz]. Motion must be slow
  /// against it: the torque of a filtered motion is not the filtered torque.
  double cutoff{20.0};
  /// Rows kept a second of each joint, 0.1 to 1000: behind the filter, rows that follow faster say little new [Hz].
  double row_rate{20.0};
  /// A joint slower than this is at rest, and tells nothing of its torque [rad/s, m/s].
  double rest_speed{0.01};
  /// Share of a friction coefficient by which it may change within a minute, as a random walk, > 0.
  double friction_drift{0.2};
  /// The same of a link's inertia. 0: what was learnt of it is kept for ever.
  double link_drift{0.01};
  /// Standard deviation of the robot's own friction, in parts of it, > 0; what the motion does not show stays there.
  double friction_spread{0.5};
  /// The same of its links. Wide, because a wrist is light and what it picks up is not.
  double link_spread{10.0};
  /// Degrees of freedom of the residuals' Student distribution: small for many outliers, ≥ 1.
  double degrees_of_freedom{4.0};
  int reweightings{2};     ///< rounds of outlier weights in a step, ≥ 1
  int max_iterations{12};  ///< of the solver in each of them, ≥ 1: bounds the time of a step
};

/// What a joint's encoder and drive gave at one time.
struct HorizonSample {
  double time{0.0};   ///< [s]
  Eigen::VectorXd q;  ///< n: positions [rad, m]
  /// n: velocities, for the sign of friction alone; size 0: from the positions [rad/s, m/s]
  Eigen::VectorXd qd;
  Eigen::VectorXd tau;  ///< n: torque since the sample before, motor's or joint's side alike [N·m, N]
};

/// What became of a sample.
enum class HorizonStatus {
  kCollected,  ///< taken; no step was due
  kFilling,    ///< taken; the first window is not full yet
  kUpdated,    ///< taken, and the estimate moved
  /// Taken; the window's motion determines nothing, so the estimate stays and its intervals widen.
  kNotExcited,
  kNotFinite,         ///< refused: a NaN, an infinity or a number beyond kLargestInput; nothing changed
  kTimeNotIncreasing  ///< refused: not later than the sample before; nothing changed
};
const char* to_string(HorizonStatus status);  ///< "updated", ...

/// The parameters at the end of a step.
struct HorizonEstimate {
  std::shared_ptr<const regression::RegressionColumns> columns;
  std::vector<int> unknown;      ///< u columns that are estimated, ascending
  Eigen::VectorXd values;        ///< p: all parameters; those that are not estimated as in the robot
  Eigen::VectorXd std;           ///< u: standard deviations, residuals correlated in time accounted for
  std::vector<bool> determined;  ///< u: by the samples so far, not by the robot's own value
  std::vector<bool> excited;     ///< u: by the samples of the window alone
  Eigen::VectorXd noise_std;     ///< n: scatter of the residual behind the filter [N·m, N]
  double time{kNaN};             ///< of the newest row [s]
  /// Of the estimated links' pseudo-inertias [kg, kg·m²]; above 0 after every step.
  double smallest_eigenvalue{kNaN};
  double outliers{0.0};   ///< share of the window's rows that count less than half
  int iterations{0};      ///< of the solver in the last step
  bool converged{false};  ///< the last step ended at its minimum, not at the bound on iterations

  const std::string& name(int i) const;        ///< of the i-th unknown: "Fc3", "Ixx6"
  const std::string& unit(int i) const;        ///< of the i-th unknown: "N·m"
  double value(int i) const;                   ///< of the i-th unknown
  statistics::Interval interval(int i) const;  ///< the same with its 95 % interval
  bool usable() const;                         ///< there is an estimate, and the samples determine some of it
  model::Robot robot() const;                  ///< the robot with these parameters
  /// The robot with these parameters, standard deviations where determined.
  model::ModelFile model_file() const;
};

/// Moving-horizon estimation: the parameters that explain the torque of the last seconds best, given what was learnt
/// before.
///
/// Minimised in each step, over pseudo-inertias that are positive definite and friction that is not negative, is
///
///     Σ over the window  w (τ − Y x)² / (σ² c)  +  ‖R x − z‖²  +  μ d(x)
///
/// w: Student's weights, so that outliers count little; σ, c: scatter and correlated samples of each joint's
/// residual, so that rows which repeat each other do not narrow the intervals; R, z: arrival cost, everything that
/// left the window as one triangular factor, widened by the drift that is allowed (square-root information filter
/// [1]); d: divergence from the robot's own parameters, which is infinite at the edge of what is possible. The torque
/// is linear in x, so the arrival cost is exact and the sum convex. It is one real-time iteration [2]: the solver
/// starts from the last step, and its steps are bounded.
///
/// A value: a copy continues by itself. Cost of a step: below 3 ms for a link and the friction of six joints, whatever
/// the sampling rate; between steps, a filter a joint.
///
/// [1] G. J. Bierman, Factorization Methods for Discrete Sequential Estimation (1977), ch. VI.
/// [2] M. Diehl, H. G. Bock, J. P. Schlöder, A real-time iteration scheme for nonlinear optimization in optimal feedback
///     control, SIAM J. Control Optim. 43 (2005).
class MovingHorizon {
 public:
  /// @param robot  kinematics, the known parameters, and the prior of the unknown ones; not all of a link may be 0
  /// @throws ModelError for settings outside their range, a link that does not exist, and a robot with effects,
  ///         elastic joints or a torque delay, which are no part of this model
  explicit MovingHorizon(const model::Robot& robot, const HorizonOptions& options = {});
  ~MovingHorizon();
  MovingHorizon(const MovingHorizon& other);
  MovingHorizon& operator=(const MovingHorizon& other);
  MovingHorizon(MovingHorizon&&) noexcept;
  MovingHorizon& operator=(MovingHorizon&&) noexcept;

  /// Takes one sample and, where a step is due, makes it. Rates may vary, from twice the cut-off on; after a gap longer than
  /// the filter remembers, 10 / (2π cutoff), it settles anew, for as long without rows.
  /// @throws ModelError when the sizes are not those of the robot
  HorizonStatus push(const HorizonSample& sample);

  /// At the end of the last step; before the first, the robot's own parameters, not usable().
  const HorizonEstimate& estimate() const;

  /// Forgets all samples but keeps the estimate as the starting point: after a known change of tool or load.
  void forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::identify
