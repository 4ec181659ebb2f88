/// @file
/// Pose of the tool, its motion with the joints, and the joint torques of a load on it.
///
/// Sources: B. Siciliano, L. Sciavicco, L. Villani, G. Oriolo, Robotics (2009), in the form of UPC-ETSEIB (2017),
/// "Experimental identification of the joints stiffness of the UR5 robot arm", whose equation
/// numbers are cited; the complementary stiffness after S. Chen and I. Kao (2000).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/trigonometry.hpp"

namespace heft {

/// A tool in the last link frame: the frame whose origin is the tip point.
template <typename Scalar>
struct ToolFrame {
  /// Tool axes expressed in the last link frame, row-major 3 × 3 (turns components in tool axes into
  /// components in link axes).
  std::array<Scalar, 9> rotation{Scalar(1), Scalar(0), Scalar(0), Scalar(0), Scalar(1),
                                 Scalar(0), Scalar(0), Scalar(0), Scalar(1)};
  std::array<Scalar, 3> position{Scalar(0), Scalar(0), Scalar(0)};  ///< of the tip point [m]
};

/// The last frame of a standard (distal) Denavit-Hartenberg table as the tool of make_standard_dh_arm's arm.
/// @param last  the table's last row
template <typename Scalar>
constexpr ToolFrame<Scalar> standard_dh_tool(const DenavitHartenberg<Scalar>& last) noexcept {
  ToolFrame<Scalar> tool;
  tool.position = {last.a, last.d * last.sin_alpha, last.d * last.cos_alpha};
  return tool;
}

/// The chain at one instant, everything in the base frame.
template <typename Scalar, int N>
struct ChainKinematics {
  Eigen::Matrix<Scalar, 3, N> axes;     ///< unit vectors of the joint axes z_i
  Eigen::Matrix<Scalar, 3, N> origins;  ///< link-frame origins p_i, points of the joint axes [m]
  std::array<JointType, static_cast<std::size_t>(N)> types;
  Eigen::Matrix<Scalar, 3, 3> rotation;  ///< tool axes in the base frame
  Eigen::Matrix<Scalar, 3, 1> position;  ///< the tip point p_e [m]
};

/// 6 × n: rows 0 to 2 the velocity of the tip point [m/rad; 1 on a prismatic joint], rows 3 to 5 the angular
/// velocity [1; 0 on a prismatic joint], one column a joint.
template <typename Scalar, int N>
using GeometricJacobian = Eigen::Matrix<Scalar, 6, N>;

/// Force [N], then moment about the tip point [N·m]: from the surroundings on the tool.
template <typename Scalar>
using ToolWrench = Eigen::Matrix<Scalar, 6, 1>;

/// The axes in which a wrench has its components, and to which it stays fixed while the arm gives way.
enum class WrenchFrame : std::uint8_t {
  kBase,  ///< direction constant in the base frame: a weight, a rope that is long
  kTool   ///< turns with the tool: a wrench that is stated in tool axes and meant that way at every pose
};

namespace kinematics_detail {

template <typename Scalar, typename A, typename B>
Eigen::Matrix<Scalar, 3, 1> cross(const A& a, const B& b) noexcept {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <typename Scalar, typename A, typename B>
Scalar dot(const A& a, const B& b) noexcept {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// R M with M row-major.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 3> times(const Eigen::Matrix<Scalar, 3, 3>& R,
                                  const std::array<Scalar, 9>& M) noexcept {
  Eigen::Matrix<Scalar, 3, 3> product;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const auto row = static_cast<Eigen::Index>(i);
      product(row, static_cast<Eigen::Index>(j)) =
          R(row, 0) * M[j] + R(row, 1) * M[3 + j] + R(row, 2) * M[6 + j];
    }
  }
  return product;
}

/// R v.
template <typename Scalar, typename V>
Eigen::Matrix<Scalar, 3, 1> turned(const Eigen::Matrix<Scalar, 3, 3>& R, const V& v) noexcept {
  return {R(0, 0) * v[0] + R(0, 1) * v[1] + R(0, 2) * v[2], R(1, 0) * v[0] + R(1, 1) * v[1] + R(1, 2) * v[2],
          R(2, 0) * v[0] + R(2, 1) * v[1] + R(2, 2) * v[2]};
}

/// Rᵀ v.
template <typename Scalar, typename V>
Eigen::Matrix<Scalar, 3, 1> turned_back(const Eigen::Matrix<Scalar, 3, 3>& R, const V& v) noexcept {
  return {R(0, 0) * v[0] + R(1, 0) * v[1] + R(2, 0) * v[2], R(0, 1) * v[0] + R(1, 1) * v[1] + R(2, 1) * v[2],
          R(0, 2) * v[0] + R(1, 2) * v[1] + R(2, 2) * v[2]};
}

/// Rotation about a unit vector (Rodrigues): a aᵀ (1 - cos) + E cos + [a]× sin, row-major.
template <typename Scalar>
constexpr std::array<Scalar, 9> axis_rotation(const std::array<Scalar, 3>& a,
                                              const SinCos<Scalar>& angle) noexcept {
  const Scalar c = angle.cos;
  const Scalar u = Scalar(1) - c;
  const Scalar x = a[0] * angle.sin;
  const Scalar y = a[1] * angle.sin;
  const Scalar z = a[2] * angle.sin;
  const Scalar xy = a[0] * a[1] * u;
  const Scalar xz = a[0] * a[2] * u;
  const Scalar yz = a[1] * a[2] * u;
  return {a[0] * a[0] * u + c, xy - z, xz + y, xy + z, a[1] * a[1] * u + c, yz - x, xz - y, yz + x,
          a[2] * a[2] * u + c};
}

}  // namespace kinematics_detail

/// Forward kinematics: axes, origins and tool at the pose q.
///
/// @param q  joint positions [rad; m on a prismatic joint]; an angle that is not finite or beyond kMaxAngle
///           makes everything behind it NaN
/// Cost: one sine and cosine and about 90 multiplications a joint.
template <typename Scalar, int N>
ChainKinematics<Scalar, N> chain_kinematics(const ArmModel<Scalar, N>& arm, const ToolFrame<Scalar>& tool,
                                            const Eigen::Matrix<Scalar, N, 1>& q) noexcept {
  using namespace kinematics_detail;
  std::array<Scalar, static_cast<std::size_t>(N)> angles;
  std::array<SinCos<Scalar>, static_cast<std::size_t>(N)> trig;
  for (int j = 0; j < N; ++j) {
    angles[static_cast<std::size_t>(j)] = q[j];
  }
  sin_cos(angles.data(), trig.data(), N);
  ChainKinematics<Scalar, N> chain;
  Eigen::Matrix<Scalar, 3, 3> R = Eigen::Matrix<Scalar, 3, 3>::Identity();
  Eigen::Matrix<Scalar, 3, 1> p = Eigen::Matrix<Scalar, 3, 1>::Zero();
  for (int j = 0; j < N; ++j) {
    const auto i = static_cast<std::size_t>(j);
    const Joint<Scalar>& joint = arm.joints[i];
    chain.types[i] = joint.type;
    // p_i = p_{i-1} + R_{i-1} r_i (31), R = R_{i-1} R_PL, z = R a (51).
    p += turned(R, joint.position);
    R = times(R, joint.rotation);
    const Eigen::Matrix<Scalar, 3, 1> axis = turned(R, joint.axis);
    chain.axes.col(j) = axis;
    if (joint.type == JointType::kRevolute) {
      // R ← R Rot(a, q) with the axis in link axes, where it is a unit vector to the last digit; with R a in
      // its place rounding would grow from joint to joint.
      R = times(R, axis_rotation(joint.axis, trig[i]));
    } else {
      p += axis * q[j];
    }
    chain.origins.col(j) = p;
  }
  chain.position = p + turned(R, tool.position);
  chain.rotation = times(R, tool.rotation);
  return chain;
}

/// Geometric Jacobian in the base frame: columns z × (p_e - p_i), z of a revolute joint (50); z, 0 of a
/// prismatic one. Cost: 6 multiplications a joint.
template <typename Scalar, int N>
GeometricJacobian<Scalar, N> geometric_jacobian(const ChainKinematics<Scalar, N>& chain) noexcept {
  using namespace kinematics_detail;
  GeometricJacobian<Scalar, N> J;
  for (int j = 0; j < N; ++j) {
    const Eigen::Matrix<Scalar, 3, 1> axis = chain.axes.col(j);
    if (chain.types[static_cast<std::size_t>(j)] == JointType::kRevolute) {
      const Eigen::Matrix<Scalar, 3, 1> arm = chain.position - chain.origins.col(j);
      J.template block<3, 1>(0, j) = cross<Scalar>(axis, arm);
      J.template block<3, 1>(3, j) = axis;
    } else {
      J.template block<3, 1>(0, j) = axis;
      J.template block<3, 1>(3, j).setZero();
    }
  }
  return J;
}

/// The same Jacobian with components in another frame: J^u = diag(Rᵀ, Rᵀ) J (56).
/// @param R  axes of that frame in the base frame, for the tool's own frame ChainKinematics::rotation
/// @param J  in the base frame, of the same tip point
template <typename Scalar, int N>
GeometricJacobian<Scalar, N> in_frame(const Eigen::Matrix<Scalar, 3, 3>& R,
                                      const GeometricJacobian<Scalar, N>& J) noexcept {
  using namespace kinematics_detail;
  GeometricJacobian<Scalar, N> turned_J;
  for (int j = 0; j < N; ++j) {
    const Eigen::Matrix<Scalar, 3, 1> linear = J.template block<3, 1>(0, j);
    const Eigen::Matrix<Scalar, 3, 1> angular = J.template block<3, 1>(3, j);
    turned_J.template block<3, 1>(0, j) = turned_back(R, linear);
    turned_J.template block<3, 1>(3, j) = turned_back(R, angular);
  }
  return turned_J;
}

/// τ = Jᵀ w (64): the torque that a wrench on the tool puts on the joints, along positive q. A drive that
/// holds the arm still has to give its opposite.
/// @param wrench  components in the frame of J
/// @return n [N·m; N on a prismatic joint]
template <typename Scalar, int N>
Eigen::Matrix<Scalar, N, 1> joint_torque(const GeometricJacobian<Scalar, N>& J,
                                         const ToolWrench<Scalar>& wrench) noexcept {
  Eigen::Matrix<Scalar, N, 1> tau;
  for (int j = 0; j < N; ++j) {
    Scalar sum{0};
    for (int r = 0; r < 6; ++r) {
      sum += J(r, j) * wrench[r];
    }
    tau[j] = sum;
  }
  return tau;
}

/// Complementary stiffness K_C = [∂Jᵀ/∂q_1 w … ∂Jᵀ/∂q_n w] (89): how the torque of a wrench changes as the
/// arm moves under it, K_C = ∂(Jᵀ w)/∂q. Element (i, j) is the change of joint i's torque with q_j.
///
/// A wrench that keeps its direction in the base frame and one that turns with the tool have different K_C:
/// UPC-ETSEIB (2017) states its wrench in tool axes, its weight hangs in the base frame. In both the force acts at
/// the tip point and the moment is about it. K_C of a force of constant direction is symmetric, it has a
/// potential; with a moment, or with a wrench that turns, it is not.
///
/// @param wrench  components in the axes that `frame` names
/// @param frame   what the wrench stays fixed to
/// @return n × n [N·m/rad; N/rad, N, N/m where joints are prismatic]
template <typename Scalar, int N>
Eigen::Matrix<Scalar, N, N> complementary_stiffness(const ChainKinematics<Scalar, N>& chain,
                                                    const ToolWrench<Scalar>& wrench,
                                                    WrenchFrame frame = WrenchFrame::kBase) noexcept {
  using namespace kinematics_detail;
  using Vector3 = Eigen::Matrix<Scalar, 3, 1>;
  const bool follows = frame == WrenchFrame::kTool;
  Vector3 force = wrench.template head<3>();
  Vector3 moment = wrench.template tail<3>();
  if (follows) {
    force = turned(chain.rotation, force);
    moment = turned(chain.rotation, moment);
  }
  const GeometricJacobian<Scalar, N> J = geometric_jacobian(chain);
  Eigen::Matrix<Scalar, N, N> K;
  for (int j = 0; j < N; ++j) {
    const Vector3 linear_j = J.template block<3, 1>(0, j);
    const Vector3 angular_j = J.template block<3, 1>(3, j);
    // The wrench's own change where it turns with the tool: ω_j × f, ω_j × m.
    const Vector3 force_change = cross<Scalar>(angular_j, force);
    const Vector3 moment_change = cross<Scalar>(angular_j, moment);
    for (int i = 0; i < N; ++i) {
      const Vector3 linear_i = J.template block<3, 1>(0, i);
      const Vector3 angular_i = J.template block<3, 1>(3, i);
      Scalar value{0};
      if (j <= i) {
        // Joint j carries axis i and the tip along: column i turns as a whole, ω_j × v_i and ω_j × ω_i; so
        // would a wrench that is fixed to the tool, and nothing would change.
        // (ω_j × v_i)·f = -v_i·(ω_j × f).
        if (!follows) {
          value = -dot<Scalar>(linear_i, force_change) - dot<Scalar>(angular_i, moment_change);
        }
      } else {
        // Axis i stays, the tip point moves with v_j: ω_i × v_j, and 0 for the angular part.
        value = dot<Scalar>(cross<Scalar>(angular_i, linear_j), force);
        if (follows) {
          value += dot<Scalar>(linear_i, force_change) + dot<Scalar>(angular_i, moment_change);
        }
      }
      K(i, j) = value;
    }
  }
  return K;
}

/// Compliance of the tool C = J diag(x) Jᵀ (69.a): displacement δd = C w of a wrench, to first order and
/// without K_C.
/// @param compliance  x_i = 1 / k_i of each joint [rad/(N·m); m/N on a prismatic joint], 0 for a rigid one
/// @return symmetric 6 × 6 in the frame of J: [m/N, 1/N; 1/N, rad/(N·m)]
template <typename Scalar, int N>
Eigen::Matrix<Scalar, 6, 6> cartesian_compliance(const GeometricJacobian<Scalar, N>& J,
                                                 const Eigen::Matrix<Scalar, N, 1>& compliance) noexcept {
  Eigen::Matrix<Scalar, 6, 6> C;
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c <= r; ++c) {
      Scalar sum{0};
      for (int j = 0; j < N; ++j) {
        sum += J(r, j) * compliance[j] * J(c, j);
      }
      C(r, c) = sum;
      C(c, r) = sum;
    }
  }
  return C;
}

}  // namespace heft
