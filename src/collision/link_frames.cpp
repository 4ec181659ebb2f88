#include "heft/collision/link_frames.hpp"

#include <cmath>

#include <Eigen/Geometry>

namespace heft::collision {

using Eigen::Matrix3d;
using Eigen::Vector3d;

LinkFrames::LinkFrames(const model::Robot& robot, const Eigen::Ref<const Eigen::VectorXd>& q)
    : num_joints(robot.num_joints()) {
  Matrix3d R = Matrix3d::Identity();
  Vector3d p = Vector3d::Zero();
  for (int j = 0; j < num_joints; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const Joint<double>& joint = robot.joints[k].joint;
    const Vector3d own_axis(joint.axis[0], joint.axis[1], joint.axis[2]);
    const Matrix3d placed =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(joint.rotation.data());
    Vector3d offset(joint.position[0], joint.position[1], joint.position[2]);
    revolute[k] = joint.type == JointType::kRevolute;
    if (!revolute[k]) offset += placed * own_axis * q[j];
    p += R * offset;
    R = R * placed;
    if (revolute[k] && own_axis == Vector3d::UnitZ()) {  // the usual one: two columns turn
      const double c = std::cos(q[j]), s = std::sin(q[j]);
      const Vector3d x = R.col(0);
      R.col(0) = c * x + s * R.col(1);
      R.col(1) = c * R.col(1) - s * x;
    } else if (revolute[k]) {
      R = R * Eigen::AngleAxisd(q[j], own_axis).toRotationMatrix();
    }
    rotation[k] = R;
    origin[k] = p;
    axis[k] = R * own_axis;
  }
}

Vector3d LinkFrames::at(int link, const Vector3d& point) const {
  if (link < 0) return point;
  const auto k = static_cast<std::size_t>(link);
  return origin[k] + rotation[k] * point;
}

void LinkFrames::add_gradient(int link, const Vector3d& P, const Vector3d& direction, double factor,
                              Eigen::Ref<Eigen::VectorXd> by_q) const {
  for (int i = 0; i <= link; ++i) {
    const auto k = static_cast<std::size_t>(i);
    by_q[i] += factor * direction.dot(revolute[k] ? axis[k].cross(P - origin[k]) : axis[k]);
  }
}

Vector3d LinkFrames::velocity(int link, const Vector3d& P,
                              const Eigen::Ref<const Eigen::VectorXd>& qd) const {
  Vector3d v = Vector3d::Zero();
  for (int i = 0; i <= link; ++i) {
    const auto k = static_cast<std::size_t>(i);
    v += qd[i] * (revolute[k] ? axis[k].cross(P - origin[k]) : axis[k]);
  }
  return v;
}

void LinkFrames::add_speed_gradient(int link, const Vector3d& P, const Eigen::Ref<const Eigen::VectorXd>& qd,
                                    double factor, Eigen::Ref<Eigen::VectorXd> by_q,
                                    Eigen::Ref<Eigen::VectorXd> by_qd) const {
  const Vector3d v = velocity(link, P, qd);
  // ∂v/∂q_i = ω × p_i + a_i × w: ω of the joints up to i turns the way p_i that P takes, and joint i turns w,
  // the part of v that the joints beyond it bring (for a joint that slides there is nothing to turn).
  Vector3d omega = Vector3d::Zero(), beyond = v;
  for (int i = 0; i <= link; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vector3d way = revolute[k] ? Vector3d(axis[k].cross(P - origin[k])) : axis[k];
    by_qd[i] += factor * v.dot(way);
    beyond -= qd[i] * way;
    if (revolute[k]) omega += qd[i] * axis[k];
    Vector3d derivative = omega.cross(way);
    if (revolute[k]) derivative += axis[k].cross(beyond);
    by_q[i] += factor * v.dot(derivative);
  }
}

double arm_length(const model::Robot& robot) {
  const auto norm = [](const std::array<double, 3>& v) { return Vector3d(v[0], v[1], v[2]).norm(); };
  double length = norm(robot.tip_position);
  for (const model::RobotJoint& joint : robot.joints) length += norm(joint.joint.position);
  return length;
}

}  // namespace heft::collision
