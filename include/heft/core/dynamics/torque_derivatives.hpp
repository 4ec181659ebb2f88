/// @file
/// Derivatives of the inverse dynamics by joint positions and velocities, exact.
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"

namespace heft {

/// Of the torque τ(q, q̇, q̈) of the rigid links, gravity included; row i is the torque of joint i.
template <typename Scalar, int N>
struct TorqueDerivatives {
  Eigen::Matrix<Scalar, N, N> dq;   ///< ∂τ/∂q at constant q̇, q̈ [N·m/rad]
  Eigen::Matrix<Scalar, N, N> dqd;  ///< ∂τ/∂q̇ [N·m·s/rad]
};

namespace detail {

/// a × b; Eigen's own needs more of Eigen than core otherwise does.
template <typename Scalar>
inline Eigen::Matrix<Scalar, 3, 1> cross3(const Eigen::Matrix<Scalar, 3, 1>& a,
                                          const Eigen::Matrix<Scalar, 3, 1>& b) noexcept {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// A spatial vector: angular and linear part of a motion, or moment and force.
template <typename Scalar>
struct Spatial {
  using Vector = Eigen::Matrix<Scalar, 3, 1>;
  Vector angular{Vector::Zero()}, linear{Vector::Zero()};

  Scalar dot(const Spatial& other) const noexcept {
    return angular.dot(other.angular) + linear.dot(other.linear);
  }
  Spatial operator+(const Spatial& b) const noexcept { return {angular + b.angular, linear + b.linear}; }
  Spatial operator*(const Scalar& s) const noexcept { return {angular * s, linear * s}; }
  /// Change of a motion that is carried along by this motion.
  Spatial cross(const Spatial& m) const noexcept {
    return {cross3(angular, m.angular), cross3(angular, m.linear) + cross3(linear, m.angular)};
  }
  /// Change of a force that is carried along by this motion.
  Spatial cross_force(const Spatial& f) const noexcept {
    return {cross3(angular, f.angular) + cross3(linear, f.linear), cross3(angular, f.linear)};
  }
};

/// A rigid body, or several that move as one: mass, first moment h and second moment S about the reference point; momentum P,
/// force F, and the matrix V of the velocity terms. B α = (V α, 2 α × P) is what a rate of turn α adds to the body's force
/// through its velocity: of the four terms of v × I a − I (v × a) + a × I v only those in the rate of turn remain.
template <typename Scalar>
struct MovingBody {
  using Vector = Eigen::Matrix<Scalar, 3, 1>;
  using Matrix = Eigen::Matrix<Scalar, 3, 3>;
  Scalar m{0};
  Vector h = Vector::Zero(), P = Vector::Zero();
  Matrix S = Matrix::Zero(), V = Matrix::Zero();
  Spatial<Scalar> F;

  Spatial<Scalar> momentum(const Spatial<Scalar>& v) const noexcept {
    return {S.trace() * v.angular - S * v.angular + cross3(h, v.linear), m * v.linear - cross3(h, v.angular)};
  }
  Spatial<Scalar> velocity_force(const Vector& turn) const noexcept {
    return {V * turn, Scalar(2) * cross3(turn, P)};
  }

  /// @param v,a  spatial velocity and acceleration, gravity included
  void move(const Spatial<Scalar>& v, const Spatial<Scalar>& a) noexcept {
    const Spatial<Scalar> p = momentum(v);
    const Spatial<Scalar> inertial = momentum(a);
    const Spatial<Scalar> gyroscopic = v.cross_force(p);
    F = inertial + gyroscopic;
    P = p.linear;
    // V α = 2 (S α × ω − h × (v × α)).
    for (int c = 0; c < 3; ++c) {
      const Vector e = Vector::Unit(c), Se = S.col(c);
      V.col(c) = Scalar(2) * (cross3(Se, v.angular) - cross3(h, cross3(v.linear, e)));
    }
  }
  void add(const MovingBody& b) noexcept {
    m += b.m, h += b.h, P += b.P, S += b.S, V += b.V;
    F = F + b.F;
  }
};

/// From the axes and origin of link j − 1 to those of link j, in the base frame.
template <typename Scalar, int N>
inline void place(const DynamicArm<Scalar, N>& arm, const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                  const JointVector<Scalar, N>& q, int j, Eigen::Matrix<Scalar, 3, 3>& R,
                  Eigen::Matrix<Scalar, 3, 1>& p) noexcept {
  const auto frame = arm.frame(j, trig.joint[static_cast<std::size_t>(j)], q[j]);
  const auto& E = frame.rotation;
  Eigen::Matrix<Scalar, 3, 3> to_parent;
  to_parent << E.row0.x, E.row1.x, E.row2.x, E.row0.y, E.row1.y, E.row2.y, E.row0.z, E.row1.z, E.row2.z;
  p += R * Eigen::Matrix<Scalar, 3, 1>(frame.position.x, frame.position.y, frame.position.z);
  R = (R * to_parent).eval();
}

}  // namespace detail

/// Both derivatives in one pass out and one back, run-time geometry.
///
/// With S_j the axis of joint j, V_j and A_j velocity and acceleration of its link (gravity included), ψ_j = V_{j−1} × S_j and
/// m = max(i, j), all as spatial vectors in base axes about one fixed point:
///
///     ∂τ_i/∂q̇_j = S_iᵀ (2 Iᶜ_m ψ_j + Bᶜ_m S_j)
///     ∂τ_i/∂q_j = S_iᵀ (Iᶜ_m (A_{j−1} × S_j + V_{j−1} × ψ_j) + Bᶜ_m ψ_j  [+ S_j × Fᶜ_j where i < j])
///
/// with inertia Iᶜ, force Fᶜ and velocity terms Bᶜ of all links from m on (the result of J. Carpentier, N. Mansard, Analytical
/// derivatives of rigid body dynamics algorithms, 2018). Turning joint j moves all links outboard as one body, and what
/// moves with them does not change in their axes; ψ and the term beside it are what does. The point is the last link's
/// origin, so that the small inertias of a wrist are not differences of large numbers.
///
/// Cost: 6 joints 3981 multiplications, 3275 additions; differences of inverse_dynamics take twice that.
///
/// @param trig      of q
/// @param q,qd,qdd  n [rad, rad/s, rad/s²; m on a prismatic joint]
template <typename Scalar, int N>
inline void torque_derivatives(const DynamicArm<Scalar, N>& arm,
                               const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                               const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                               const JointVector<Scalar, N>& qdd,
                               TorqueDerivatives<Scalar, N>& out) noexcept {
  using Motion = detail::Spatial<Scalar>;
  using Body = detail::MovingBody<Scalar>;
  using Vector = typename Body::Vector;
  using Matrix = typename Body::Matrix;
  // Frames are placed twice rather than kept: a third of the stack.
  Matrix R = Matrix::Identity();
  Vector p = Vector::Zero();
  for (int j = 0; j < N; ++j) {
    detail::place(arm, trig, q, j, R, p);
  }
  const Vector point = p;
  R.setIdentity();
  p.setZero();
  std::array<Motion, N> S, psi, by_position;
  std::array<Body, N> body;
  Motion v, a;
  const auto lift = arm.base_acceleration();
  a.linear = Vector(lift.x, lift.y, lift.z);
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    detail::place(arm, trig, q, j, R, p);
    const Vector from_point = p - point, axis = R.col(2);
    S[i] = arm.joint_type(j) == JointType::kRevolute ? Motion{axis, detail::cross3(from_point, axis)}
                                                     : Motion{Vector::Zero(), axis};
    psi[i] = v.cross(S[i]);
    by_position[i] = a.cross(S[i]) + v.cross(psi[i]);
    v = v + S[i] * qd[j];
    a = a + S[i] * qdd[j] + psi[i] * qd[j];

    const auto link = arm.link(j);
    Matrix second;
    second << link.s11, link.s12, link.s13, link.s12, link.s22, link.s23, link.s13, link.s23, link.s33;
    const Vector h = R * Vector(link.h.x, link.h.y, link.h.z);
    const Matrix cross_moment = h * from_point.transpose();
    Body& b = body[i];
    b.m = link.m;
    b.h = h + link.m * from_point;
    b.S = R * second * R.transpose() + cross_moment + cross_moment.transpose() +
          link.m * from_point * from_point.transpose();
    b.move(v, a);
  }

  for (int i = N - 1; i >= 0; --i) {
    const std::size_t k = static_cast<std::size_t>(i);
    const Body& b = body[k];
    // Row i, columns up to i.
    const Motion momentum = b.momentum(S[k]);
    const Vector turned = b.V.transpose() * S[k].angular + Scalar(2) * detail::cross3(b.P, S[k].linear);
    for (int j = 0; j <= i; ++j) {
      const std::size_t c = static_cast<std::size_t>(j);
      out.dqd(i, j) = Scalar(2) * momentum.dot(psi[c]) + turned.dot(S[c].angular);
      out.dq(i, j) = momentum.dot(by_position[c]) + turned.dot(psi[c].angular);
    }
    // Column i, rows above.
    const Motion of_velocity = b.momentum(psi[k]) * Scalar(2) + b.velocity_force(S[k].angular);
    const Motion of_position =
        b.momentum(by_position[k]) + b.velocity_force(psi[k].angular) + S[k].cross_force(b.F);
    for (int r = 0; r < i; ++r) {
      out.dqd(r, i) = S[static_cast<std::size_t>(r)].dot(of_velocity);
      out.dq(r, i) = S[static_cast<std::size_t>(r)].dot(of_position);
    }
    if (i > 0) {
      body[k - 1].add(b);
    }
  }
}

}  // namespace heft
