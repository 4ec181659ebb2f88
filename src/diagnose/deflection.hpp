/// @file
/// How far elastic joints give along a motion.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "motion_table.hpp"

namespace heft::diagnose {

/// Deflections e = θ - x of k joints and their derivatives, m × k each.
struct Deflections {
  Eigen::MatrixXd value, rate, acceleration;
};

/// Solves M(t) ë + D ė + K e = load(t) row by row from static equilibrium, with what the links of the joints share of the inertia:
/// e follows from torques that a motion asks for, without differentiating them.
/// @param load       rigid-body torque of each at the motors' motion, m × k [N·m]
/// @param inertia    M along the motion by its lower part, m × k²: entry (a, b) in column a k + b
/// @param stiffness, damping  k [N·m/rad, N·m·s/rad]
/// @return no rows where M is not positive definite in each row
Deflections deflections(const MotionTable& table, const Eigen::MatrixXd& load, const Eigen::MatrixXd& inertia,
                        const Eigen::VectorXd& stiffness, const Eigen::VectorXd& damping);

/// Accelerations ë alone, for several loads of the same joints.
/// @param loads  of each joint, m × c
/// @return of each joint, m × c; nothing where M is not positive definite in each row
std::vector<Eigen::MatrixXd> deflection_accelerations(const MotionTable& table, const std::vector<Eigen::MatrixXd>& loads,
                                                      const Eigen::MatrixXd& inertia, const Eigen::VectorXd& stiffness,
                                                      const Eigen::VectorXd& damping);

}  // namespace heft::diagnose
