/// @file
/// How far elastic joints give along a motion.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/model/robot.hpp"
#include "motion_table.hpp"

namespace heft::diagnose {

/// Deflections e = θ - x of k joints and their derivatives, m × k each.
struct Deflections {
  Eigen::MatrixXd value, rate, acceleration;
};

/// Rigid-body torque along a motion, and what it changes by when the links of k joints move: δτ = Σ_b M_b δẍ_b + G_b δx_b.
struct LinkTorque {
  std::vector<int> joints;  ///< k
  Eigen::MatrixXd torque;   ///< m × n [N·m]
  Eigen::MatrixXd mass;     ///< m × n k: of each joint its column of the mass matrix
  Eigen::MatrixXd slope;    ///< the same of G = ∂τ/∂q, of which gravity is most [N·m/rad]

  Eigen::Index num_joints() const { return torque.cols(); }
  /// Entries of M and of G along the motion: what the b-th of the k joints does to the torque of joint i.
  auto inertia(int i, Eigen::Index b) const { return mass.col(num_joints() * b + i); }
  auto stiffness(int i, Eigen::Index b) const { return slope.col(num_joints() * b + i); }
  /// What the k joints do to each other, m × k²: f(joint, b) of the a-th and b-th in column a k + b.
  template <typename F>
  Eigen::MatrixXd shared(const F& f) const {
    const auto k = static_cast<Eigen::Index>(joints.size());
    Eigen::MatrixXd all(torque.rows(), k * k);
    for (Eigen::Index a = 0; a < k; ++a) {
      for (Eigen::Index b = 0; b < k; ++b) all.col(a * k + b) = f(joints[static_cast<std::size_t>(a)], b);
    }
    return all;
  }
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
/// @param slope      G along the motion as the inertia, all of it; no columns: 0
/// @return no rows where M is not positive definite in each row, or K + G of a joint not positive on average
Deflections deflections(const MotionTable& table, const Eigen::MatrixXd& load, const Eigen::MatrixXd& inertia,
                        const Eigen::VectorXd& stiffness, const Eigen::VectorXd& damping, const Eigen::MatrixXd& slope = {});

/// What several loads of the same joint do: e and ë, m × c each.
struct ManyDeflections {
  Eigen::MatrixXd value, acceleration;
};

/// The same for several loads of the same joints.
/// @param loads  of each joint, m × c
/// @return of each joint; nothing where there are no deflections
std::vector<ManyDeflections> deflections_by_loads(const MotionTable& table, const std::vector<Eigen::MatrixXd>& loads,
                                                  const Eigen::MatrixXd& inertia, const Eigen::VectorXd& stiffness,
                                                  const Eigen::VectorXd& damping, const Eigen::MatrixXd& slope = {});

}  // namespace heft::diagnose
