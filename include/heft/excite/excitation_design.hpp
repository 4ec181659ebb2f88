/// @file
/// Motions that make parameters visible: finite Fourier series designed for the regression that will follow.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/excite/fourier_motion.hpp"
#include "heft/excite/motion_limits.hpp"
#include "heft/model/robot.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::excite {

using regression::ModelStructure;
using regression::RegressionColumns;

/// The cost that the search minimises.
enum class ExcitationCost {
  /// −log det F / 2b, F the information matrix of b base parameters: the mean logarithm of their standard
  /// deviations (of their principal axes, exactly), whatever the units.
  kDOptimal,
  /// Condition number of the observation matrix with columns scaled to norm 1.
  kCondition
};

/// How the rows of different joints are weighted in F.
enum class RowWeights {
  kTorqueLimit,  ///< 1 over the joint's torque limit (over its noise where that is given)
  kUnit          ///< 1
};

struct ExcitationOptions {
  double duration{20.0};  ///< [s]
  double period{0.0};     ///< of the first harmonic [s]; 0: the duration
  int harmonics{5};
  ExcitationCost cost{ExcitationCost::kDOptimal};
  RowWeights weights{RowWeights::kTorqueLimit};
  /// Columns of the regression: rigid bodies and linear friction. Couplings of the robot have to be named here
  /// too when their parameters are sought.
  ModelStructure structure{false, true, true, false, {}};
  /// The arm is known; only the ten parameters of the last link, a load on it, are sought.
  bool payload_only{false};
  Eigen::VectorXd start;  ///< position at both ends, n; size 0: free
  /// Standard deviation of the torque of each joint, n [N·m, N]; size 0: 1 % of the torque limit, which must
  /// then be finite (else 1).
  Eigen::VectorXd torque_noise;
  /// Sample rate of the log to be recorded: over how many rows the noise is averaged [Hz].
  double sample_rate{100.0};
  int starts{8};        ///< random motions that the search begins with
  int finalists{3};     ///< of which this many are searched to the end
  int iterations{400};  ///< of the search from one finalist
  int threads{0};       ///< 0: one a processor. The result does not depend on it.
  std::uint64_t seed{1};
};

/// What a motion reveals about the base parameters, sharp sign of friction.
struct ExcitationScore {
  double condition{0.0};            ///< of W with unit columns, rows weighted as chosen
  double condition_unit_rows{0.0};  ///< the same with unweighted rows
  double log_det{0.0};              ///< of F = Σ_rows w wᵀ / σ², given logs included (natural logarithm)
  Eigen::VectorXd std;              ///< of base parameters for white torque noise, b
  double mean_std{0.0};             ///< geometric mean of `std`
  double volume_std{0.0};  ///< exp(−log_det / 2b): geometric mean over the principal axes of F⁻¹
};

/// A finished design.
struct Excitation {
  ExcitationTrajectory trajectory;
  ExcitationScore score;
  LimitUse use;
  std::vector<double> history;  ///< cost at every iteration of the winner's search
  std::vector<double> costs;    ///< cost each start ended with; NaN where none could be had
  int winner{0};                ///< index of the start
  double scale{1.0};  ///< by which the motion was drawn together at last, so that limits hold between samples
};

/// Designs exciting motions for one robot.
///
/// Rest at both ends by elimination: velocity and acceleration at t = 0 and t = duration are linear in the
/// coefficients, so the search runs over an orthonormal basis of the coefficients that make them zero (2K − 2
/// numbers a joint for a whole number of periods). A blend at the ends would spend time on motion that excites
/// little, and the period could not be repeated and averaged.
///
/// Search: Ceres' BFGS from several random motions, limits by a logarithmic barrier over samples of one period
/// that is lowered step by step, so that every motion on the way keeps the limits. Gradients are exact: one pass
/// outward along the arm and one back, chain rule on the coefficients (excitation.md). Friction's
/// sign is smooth in the search and sharp in every figure given out. Last, the motion is checked on a tenfold
/// finer grid and drawn together about its middle until the limits hold there.
///
/// Torque limits are kept for either sign of Coulomb friction, because a joint that reverses takes any torque
/// between. Links are kept apart as capsules, by the closed form of their distances.
class ExcitationDesign {
 public:
  struct Impl;

  /// @throws ModelError when limits contradict themselves or one another, the start is outside them, or the
  ///         options are out of range.
  ExcitationDesign(const model::Robot& robot, const MotionLimits& limits, ExcitationOptions options);
  ~ExcitationDesign();
  ExcitationDesign(ExcitationDesign&&) noexcept;
  ExcitationDesign& operator=(ExcitationDesign&&) noexcept;

  const MotionLimits& limits() const;
  const ExcitationOptions& options() const;
  int num_parameters() const;                           ///< b
  const std::vector<std::string>& names() const;        ///< of the base parameters, b
  const std::vector<std::string>& units() const;        ///< b
  const std::vector<std::string>& expressions() const;  ///< closed forms, b
  const Eigen::VectorXd& torque_noise() const;          ///< σ, n [N·m, N]
  /// Base parameters that follow from the robot's present parameters, b.
  Eigen::VectorXd values() const;
  const RegressionColumns& columns() const;
  const std::vector<int>& kept() const;  ///< columns that represent the base parameters

  /// Adds the information of a log already recorded. Rows of joints slower than 1 % of their velocity limit are left out.
  /// @param q,qd,qdd  m × n
  /// @param seconds   time that one row represents
  void add_given(const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd,
                 double seconds);

  /// A random motion inside the limits: normally distributed coefficients, each joint as fast as its velocity and
  /// range allow, then drawn together about a random position until everything else holds.
  /// @throws NotIdentifiableError when no position inside the limits can be held or nothing can move there.
  ExcitationTrajectory random_motion(std::uint64_t seed) const;

  ExcitationScore score(const ExcitationTrajectory& motion) const;
  /// Score of the given logs alone; nothing without them or when they determine too little.
  std::optional<ExcitationScore> given_score() const;
  LimitUse use_of(const ExcitationTrajectory& motion) const;
  /// Torque that the robot's parameters predict, friction included, n.
  Eigen::VectorXd torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                         const Eigen::VectorXd& qdd) const;

  /// @param progress  called with 0..1, from the calling thread; may be empty
  /// @throws NotIdentifiableError as random_motion, and when the best motion leaves parameters undetermined.
  Excitation optimize(const std::function<void(double)>& progress = {}) const;

  // For tests: the function that is searched.
  int num_variables() const;
  Eigen::VectorXd encode(const ExcitationTrajectory& motion) const;
  ExcitationTrajectory decode(const Eigen::VectorXd& variables) const;
  /// Cost plus barrier/samples · Σ −log(slack).
  /// @param gradient  out, may be null
  /// @return infinite outside the limits
  double cost(const Eigen::VectorXd& variables, double barrier, Eigen::VectorXd* gradient = nullptr) const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::excite
