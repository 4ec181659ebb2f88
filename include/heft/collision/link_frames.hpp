/// @file
/// Where the links of a robot are and how points on them move.
#pragma once

#include <array>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::collision {

/// Link frames and joint axes in the base frame at one position; link −1 is the base. Without heap.
struct LinkFrames {
  /// @param q  n [rad, m]
  LinkFrames(const model::Robot& robot, const Eigen::Ref<const Eigen::VectorXd>& q);

  int num_joints{0};
  std::array<Eigen::Matrix3d, model::kMaxJoints> rotation;
  std::array<Eigen::Vector3d, model::kMaxJoints> origin, axis;
  std::array<bool, model::kMaxJoints> revolute;

  /// A point given in a link's frame, in the base frame [m].
  Eigen::Vector3d at(int link, const Eigen::Vector3d& point) const;

  /// Adds factor · ∂(direction · P)/∂q to `by_q` (n) for a point P of a link.
  /// @param P  in the base frame [m]
  void add_gradient(int link, const Eigen::Vector3d& P, const Eigen::Vector3d& direction, double factor,
                    Eigen::Ref<Eigen::VectorXd> by_q) const;

  /// Velocity of a point P of a link [m/s]. With gradients: adds factor · ∂(½ v²)/∂q and ∂(½ v²)/∂q̇.
  Eigen::Vector3d velocity(int link, const Eigen::Vector3d& P,
                           const Eigen::Ref<const Eigen::VectorXd>& qd) const;
  void add_speed_gradient(int link, const Eigen::Vector3d& P, const Eigen::Ref<const Eigen::VectorXd>& qd,
                          double factor, Eigen::Ref<Eigen::VectorXd> by_q,
                          Eigen::Ref<Eigen::VectorXd> by_qd) const;
};

/// Sum of the distances from joint to joint and on to the tip [m]: the scale of the arm.
double arm_length(const model::Robot& robot);

}  // namespace heft::collision
