/// @file
/// How far elastic joints give along a motion.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Deflections e = θ - x of k joints and their derivatives, m × k each.
struct Deflections {
  Eigen::MatrixXd value, rate, acceleration;
};

/// Rigid-body torque along a motion, and what it changes by when the links of k joints move: δτ_i = Σ_j M_ij δẍ_j + G_ij δx_j.
struct LinkTorque {
  std::vector<int> joints;  ///< k
  Eigen::MatrixXd torque;   ///< of these joints, m × k [N·m]
  Eigen::MatrixXd mass;     ///< m × n k: of each joint its column of the mass matrix
  Eigen::MatrixXd slope;    ///< the same of G = ∂τ/∂q, of which gravity is most [N·m/rad]

  /// Entries of M and G along the motion: what joint j, one of the k, does to the torque of any joint i.
  auto inertia(int i, int j) const { return mass.col(column(i, j)); }
  auto stiffness(int i, int j) const { return slope.col(column(i, j)); }
  /// The same of some of the k joints among themselves: entry (a, b) in column a count + b.
  Eigen::MatrixXd inertias(std::span<const int> some) const { return among(some, mass); }
  Eigen::MatrixXd slopes(std::span<const int> some) const { return among(some, slope); }

 private:
  Eigen::Index column(int i, int j) const;
  Eigen::MatrixXd among(std::span<const int> some, const Eigen::MatrixXd& of) const;
};

/// Cost: the inverse dynamics of every row once and once for each of the k joints, and its mass matrix; on all cores.
/// @param q, qd, qdd  m × n
/// @param joints      of which no two are the same
LinkTorque link_torque(const model::Robot& robot, const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd,
                       const Eigen::MatrixXd& qdd, const std::vector<int>& joints);

/// Solves M(t) ë + D ė + (K + G(t)) e = load(t) row by row from static equilibrium, with what the links of the joints share of the
/// inertia: e follows from torques that a motion asks for, without differentiating them.
/// @param load       rigid-body torque of each at the motors' motion, m × k [N·m]
/// @param inertia    M along the motion by its lower part, m × k²: entry (a, b) in column a k + b
/// @param stiffness, damping  k [N·m/rad, N·m·s/rad]
/// @param slope      G along the motion as the inertia, all of it
/// @return no rows where M is not positive definite in each row, or K + G of a joint not positive on average
Deflections deflections(const MotionTable& table, const Eigen::MatrixXd& load, const Eigen::MatrixXd& inertia,
                        const Eigen::VectorXd& stiffness, const Eigen::VectorXd& damping, const Eigen::MatrixXd& slope);

/// What several loads of the same joint do: e and ë, m × c each.
struct ManyDeflections {
  Eigen::MatrixXd value, acceleration;
};

/// The same for several loads of the same joints.
/// @param loads  of each joint, m × c
/// @return of each joint; nothing where there are no deflections
std::vector<ManyDeflections> deflections_by_loads(const MotionTable& table, const std::vector<Eigen::MatrixXd>& loads,
                                                  const Eigen::MatrixXd& inertia, const Eigen::VectorXd& stiffness,
                                                  const Eigen::VectorXd& damping, const Eigen::MatrixXd& slope);

}  // namespace heft::diagnose
