/// @file
/// Shared by the parts of ExcitationDesign.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "differentiable_regressor.hpp"
#include "heft/excite/excitation_design.hpp"
#include "heft/model/dynamics.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {

/// Position, velocity and acceleration of the 2K basis functions at some instants (rows).
struct FourierBasis {
  Eigen::MatrixXd q, qd, qdd;
};

/// A position to start from is at least so far inside, as a share of every limit.
inline constexpr double kRoom = 0.01;

struct ExcitationDesign::Impl {
  Impl(const model::Robot& robot, const MotionLimits& limits, ExcitationOptions given_options);

  // Steps of the constructor.
  /// Parameters of the last link that some motion of this arm distinguishes from those before them.
  void choose_last_link();
  void choose_base_parameters();
  void set_weights(const Eigen::VectorXd& torque_limits);
  /// One period where the duration holds whole ones, which all look alike; else the duration.
  void choose_span();
  /// Coefficients c = [a; b] with C c = 0: velocity and acceleration at both ends.
  void keep_ends_at_rest();
  void choose_instants(const MotionLimits& limits);
  /// @throws ModelError when the arm cannot be held at the start.
  void check_start(const MotionLimits& limits) const;

  int n() const { return columns.num_joints(); }
  int b() const { return static_cast<int>(kept.size()); }
  bool free_start() const { return options.start.size() == 0; }
  double omega() const;

  FourierBasis basis_at(const Eigen::VectorXd& times) const;
  /// Velocity coefficients [a; b] of all joints, 2K × n.
  static Eigen::MatrixXd coefficients(const ExcitationTrajectory& motion);
  ExcitationTrajectory make(const Eigen::VectorXd& start, const Eigen::MatrixXd& coefficients) const;

  ExcitationTrajectory decode(const Eigen::VectorXd& x) const;
  Eigen::VectorXd encode(const ExcitationTrajectory& motion) const;

  /// Objective of an information matrix; S = ∂objective/∂F. False when F is singular.
  bool objective(const Eigen::MatrixXd& F, double& value, Eigen::MatrixXd* S) const;
  /// Cost as ExcitationDesign::cost; false outside the limits. `pure` is the objective without barrier.
  bool evaluate(const Eigen::VectorXd& x, double barrier, double& cost, Eigen::VectorXd* gradient,
                double* pure = nullptr) const;

  class SpaceBarrier;
  struct Barrier;
  /// Barrier of positions, velocities and accelerations. False outside.
  bool motion_barrier(const Samples& motion, Barrier& barrier) const;
  /// Barrier of the torques, with friction of either sign. False outside. rows: of the regressor, one matrix a joint.
  bool torque_barrier(const Samples& motion, Barrier& barrier, std::vector<Eigen::MatrixXd>& rows) const;
  /// F = ∫ Yᵀ Λ² Y dt over the duration, with what is given.
  Eigen::MatrixXd searched_information(const std::vector<Eigen::MatrixXd>& rows, double dt) const;
  /// Adds the derivatives of objective and torque barrier by the motion to the barrier's. S = ∂objective/∂F.
  void add_objective_slope(const Samples& motion, const std::vector<Eigen::MatrixXd>& rows,
                           const Eigen::MatrixXd& S, double dt, Barrier& barrier) const;

  Samples samples_of(const ExcitationTrajectory& motion, const FourierBasis& basis) const;
  /// Barrier of everything that is limited in space over the dense samples: Σ log slack is added to `sum`, its
  /// derivatives, times −barrier, to the others (samples × n). False outside.
  bool space_barrier(const Samples& dense_motion, double barrier, bool with_gradient, double& sum,
                     Eigen::MatrixXd& by_q, Eigen::MatrixXd& by_qd) const;
  /// Drawn together about `middle` by the largest factor that keeps the limits on this basis; 0: none does.
  double drawn_together(const ExcitationTrajectory& motion, const FourierBasis& basis, double step,
                        ExcitationTrajectory& result) const;
  ExcitationTrajectory scaled(const ExcitationTrajectory& motion, double factor) const;
  ExcitationTrajectory random_motion(std::uint64_t seed) const;
  /// How fast each joint may turn with the others at rest and the arm stretched out, n.
  Eigen::VectorXd fastest_alone() const;

  /// Information matrices of a motion a unit of weight squared and second: with noise weights and unit rows.
  void information(const ExcitationTrajectory& motion, Eigen::MatrixXd& by_noise,
                   Eigen::MatrixXd& by_unit) const;
  ExcitationScore score_of(const Eigen::MatrixXd& by_noise, const Eigen::MatrixXd& by_unit) const;
  /// Parameters in the direction that F determines least.
  std::string weakest(const Eigen::MatrixXd& F) const;

  Excitation optimize(const std::function<void(double)>& progress) const;

  ExcitationOptions options;
  LimitCheck bounds;
  RegressionColumns columns;
  model::Dynamics dynamics;
  std::vector<int> kept;
  std::vector<std::string> names, units, expressions;
  Eigen::MatrixXd regrouping;  ///< G of BaseParameters
  std::unique_ptr<DifferentiableRegressor> regressor;
  Eigen::VectorXd noise;    ///< σ, n
  Eigen::VectorXd weights;  ///< of rows in the search, n

  int repeats{1};           ///< periods in the duration, when whole
  double span{0.0};         ///< time that the search looks at: one period, or the duration
  Eigen::MatrixXd at_rest;  ///< orthonormal basis of coefficients at rest at both ends, 2K × m
  Eigen::VectorXd times;    ///< of the search's samples
  /// Search, its walls (a tool moves by decimetres between the coarse samples), and the final check.
  FourierBasis coarse, dense, fine;
  Eigen::MatrixXd given_noise, given_unit;
  bool has_given{false};
};

}  // namespace heft::excite
