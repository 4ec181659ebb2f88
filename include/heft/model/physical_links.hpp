/// @file
/// Whether bodies can have a robot's inertial parameters.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "heft/core/inertia.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// Pseudo-inertia [Σ h; hᵀ m] of a link, 4 × 4 symmetric: Σ = ∫ x xᵀ dm [kg·m²], h = m c [kg·m]. A body can have the
/// parameters where it is positive definite (Wensing, Kim, Slotine, IEEE RA-L 3, 2018).
Eigen::Matrix4d pseudo_inertia_matrix(const InertialParameters<double>& link);
/// The link with a pseudo-inertia.
InertialParameters<double> link_with(const Eigen::Matrix4d& pseudo_inertia);

/// Whether a body can have these parameters: pseudo-inertia positive definite, with room for rounding.
bool is_physical(const InertialParameters<double>& link);
/// The same of every link.
bool has_physical_links(const Robot& robot);
/// Whether an arm can have all parameters: physical links, and drives without negative rotor inertia, Coulomb or viscous
/// friction. This is what "physically consistent" means wherever heft says it.
bool is_physically_consistent(const Robot& robot);

/// Nearest parameters that a body can have: eigenvalues of the pseudo-inertia below margin · max(trace, 1) are
/// lifted to there. Parameters that are physical with that margin come back unchanged.
InertialParameters<double> nearest_physical(const InertialParameters<double>& link, double margin = 1e-6);

/// What a mass matrix is like over many poses.
struct MassMatrixCheck {
  int poses{0};
  int not_positive{0};              ///< poses in which the mass matrix of the links is not positive definite
  int not_positive_with_rotors{0};  ///< the same with rotor inertia (gear couplings too) added
  double smallest_eigenvalue{0.0};  ///< of the links' mass matrix over all poses [kg·m², kg]
  Eigen::VectorXd worst_pose;       ///< where that was
};

/// Looks at the mass matrix in random poses: revolute joints over a full turn, prismatic ones within their limits
/// (±1 m without limits).
/// @throws ModelError as BatchDynamics does.
MassMatrixCheck check_mass_matrix(const Robot& robot, int poses, std::uint64_t seed);

}  // namespace heft::model
