/// @file
/// What the parts of ExcitationDesign share.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "excitation_regressor.hpp"
#include "heft/identify/excitation.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::identify {

/// Position, velocity and acceleration of the 2K basis functions at some instants (rows).
struct FourierBasis {
  Eigen::MatrixXd q, qd, qdd;
};

/// A point that moves with a link has to stay on one side of a plane: normal · P ≥ bound, base frame.
struct Wall {
  int link;
  Eigen::Vector3d point;  ///< in the link frame
  Eigen::Vector3d normal;
  double bound;  ///< [m]
  std::string name;
  bool is_floor;
};

/// Where a motion is nearest to leaving the limits. Slack is a share of the limit (metres for walls).
struct Closest {
  double slack{0.0};
  std::string what;
};

struct ExcitationDesign::Impl {
  Impl(const model::Robot& robot, MotionLimits given_limits, ExcitationOptions given_options);

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

  /// Smallest slack over instants (rows of the basis); stops at the first below `enough`.
  Closest closest(const ExcitationTrajectory& motion, const FourierBasis& basis, double enough) const;
  /// Slack of standing still at q.
  Closest closest_at_rest(const Eigen::VectorXd& q) const;
  /// Drawn together about `middle` by the largest factor that keeps the limits on this basis; 0: none does.
  double drawn_together(const ExcitationTrajectory& motion, const FourierBasis& basis, double step,
                        ExcitationTrajectory& result) const;
  ExcitationTrajectory scaled(const ExcitationTrajectory& motion, double factor) const;
  ExcitationTrajectory random_motion(std::uint64_t seed) const;

  /// Information matrices of a motion a unit of weight squared and second: with noise weights and unit rows.
  void information(const ExcitationTrajectory& motion, Eigen::MatrixXd& by_noise,
                   Eigen::MatrixXd& by_unit) const;
  ExcitationScore score_of(const Eigen::MatrixXd& by_noise, const Eigen::MatrixXd& by_unit) const;
  /// Parameters in the direction that F determines least.
  std::string weakest(const Eigen::MatrixXd& F) const;

  Excitation optimize(const std::function<void(double)>& progress) const;

  MotionLimits limits;
  ExcitationOptions options;
  RegressionColumns columns;
  model::Dynamics dynamics;
  std::vector<int> kept;
  std::vector<std::string> names, units, expressions;
  Eigen::MatrixXd regrouping;  ///< G of BaseParameters
  std::unique_ptr<DifferentiableRegressor> regressor;
  Eigen::VectorXd noise;    ///< σ, n
  Eigen::VectorXd weights;  ///< of rows in the search, n

  // Limits less their margin.
  Eigen::VectorXd middle, half, velocity, acceleration, torque;
  Eigen::VectorXd coulomb;
  std::vector<Wall> walls;
  Eigen::Vector3d up{Eigen::Vector3d::Zero()};

  int repeats{1};           ///< periods in the duration, when whole
  double span{0.0};         ///< time that the search looks at: one period, or the duration
  Eigen::MatrixXd at_rest;  ///< orthonormal basis of coefficients at rest at both ends, 2K × m
  Eigen::VectorXd times;    ///< of the search's samples
  /// Search, its walls (a tool moves by decimetres between the coarse samples), and the final check.
  FourierBasis coarse, dense, fine;
  Eigen::MatrixXd given_noise, given_unit;
  bool has_given{false};
};

}  // namespace heft::identify
