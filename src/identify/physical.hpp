/// @file
/// Fits whose links are physically possible: positive mass, an inertia that a body can have, friction that takes energy.
/// Derivation: src/identify/physical.md
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/base_parameters.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

struct PhysicalOptions {
  /// Weight of the prior against the data. 1: the divergence from the prior counts like minus the logarithm of
  /// a probability next to rows with independent noise, so it fades as rows come in. On measured logs this
  /// predicts better what the fit has not seen than a vanishing weight: bodies at the very edge of what is
  /// possible fit the training log's model errors.
  double prior_weight{1.0};
  /// Share of the squared error that the prior may cost at most, against a vanishing weight; the weight is
  /// lowered to keep it. 0.05 is 2.5 % of the RMSE. 0: no prior but where the data are silent.
  double prior_share{0.05};
  /// Least distance from the boundary: a link's pseudo-inertia stays above this part of its prior's (in the
  /// sense of quadratic forms).
  double margin{1e-6};
  int max_iterations{5000};  ///< of the line search method, over all weights of the prior together
};

/// A physically consistent fit.
struct PhysicalFit {
  Eigen::VectorXd x;     ///< p, all parameters of the regression
  Eigen::VectorXd beta;  ///< b, G x
  bool converged{false};
  int iterations{0};
  double squared_error{0.0};                ///< ‖R β − z‖² + ρ² at this solution
  double unconstrained_squared_error{0.0};  ///< the same at the least squares solution
  /// The same with the weight of the prior going to 0: what physics alone allows.
  double limit_squared_error{0.0};
  /// By how much the squared error of any other physical set (of no larger trace) can be below
  /// limit_squared_error: from the dual problem, whatever the solver did.
  double gap{0.0};
  /// Links (from 1) whose prior is physically impossible; the nearest possible one was used.
  std::vector<int> repaired_prior;
  /// Links (from 1) whose prior was more than tenfold too light; its size was taken from the data instead.
  std::vector<int> rescaled_prior;
  /// Links (from 1) that end at the edge of what is possible, the one that costs most first; not those that
  /// cost less than a tenth of it.
  std::vector<int> at_boundary;
  /// Columns of the regression (rotor inertia, friction) that the data would rather have negative; they are 0.
  std::vector<int> at_zero;
  std::string summary;  ///< the solver's brief report
};

/// Least squares over physically possible links: pseudo-inertias positive definite by construction (kept as their
/// Cholesky factors [1]), rotor inertia, Coulomb and viscous friction not negative, offsets free.
///
/// minimise ‖R₁ G x − z‖² + ρ² + μ d(x), d the Bregman divergence of −log det from the prior, Σ tr(P₀⁻¹ P) −
/// log det(P₀⁻¹ P) − 4 over the links [2], the same with 1 × 1 matrices for friction and rotor inertia. d does
/// not depend on units or frames. μ is lowered tenfold from stage to stage; Ceres (BFGS) does each stage. The sum
/// is convex in x at every μ: there is one minimum, and a prior far away costs time only.
///
/// [1] C. Rucker, P. M. Wensing, Smooth parameterization of rigid-body inertia, IEEE RA-L 7 (2022).
/// [2] T. Lee, P. M. Wensing, F. C. Park, Geometric robot dynamic identification: a convex programming approach,
///     IEEE T-RO 36 (2020).
///
/// @param data   rows in base parameters (b columns), already weighted by the noise of each joint
/// @param prior  p: the URDF's values. A physically impossible link is moved to the nearest possible one; one
///               without mass is taken as a rod from its joint to the next with the median of the other links'
///               masses.
///               Friction or rotor inertia of 0 counts as unknown.
/// @throws ModelError when sizes differ or a number is not finite.
/// Cost: below 0.1 s for seven joints.
PhysicalFit fit_physical(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                         const regression::TriangularFactor& data, const Eigen::VectorXd& prior,
                         const PhysicalOptions& options = {});

}  // namespace heft::identify
