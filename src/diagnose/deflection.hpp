/// @file
/// How far an elastic joint gives along a motion.
#pragma once

#include <Eigen/Core>

#include "motion_table.hpp"

namespace heft::diagnose {

/// Deflection e = θ - x of one joint and its derivatives, m each.
struct Deflection {
  Eigen::VectorXd value, rate, acceleration;
};

/// Solves M(t) ë + D ė + K e = load(t) row by row from static equilibrium: e follows from torques that a motion
/// asks for, without differentiating them.
/// @param load     rigid-body torque of the joint at the motor's motion, m [N·m]
/// @param inertia  M_jj along the motion, m, positive
Deflection deflection(const MotionTable& table, const Eigen::VectorXd& load, const Eigen::VectorXd& inertia,
                      double stiffness, double damping);

}  // namespace heft::diagnose
