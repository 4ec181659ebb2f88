/// @file
/// Gravity and bias torques, mass matrix and forward dynamics.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Joint-space mass matrix M(q), symmetric [kg·m², kg, kg·m].
template <typename Scalar, int N>
using MassMatrix = Eigen::Matrix<Scalar, N, N>;

namespace structural {

/// Force and moment on a body that a joint accelerates from rest by one, without gravity, about axis a: f = a × h and
/// n = ∫ r × (a × r) dm = (tr Σ E − Σ) a.
template <typename Axis, typename Body>
constexpr auto unit_turn(const Axis& a, const Body& body) {
  return make_wrench(cross(a, body.h),
                     vec3(lazy_times([&] { return body.s22 + body.s33; }, a.x) - body.s12 * a.y - body.s13 * a.z,
                          lazy_times([&] { return body.s11 + body.s33; }, a.y) - body.s12 * a.x - body.s23 * a.z,
                          lazy_times([&] { return body.s11 + body.s22; }, a.z) - body.s13 * a.x - body.s23 * a.y));
}
/// The same along axis a: f = m a and n = h × a.
template <typename Axis, typename Body>
constexpr auto unit_push(const Axis& a, const Body& body) {
  return make_wrench(scale(a, body.m), cross(body.h, a));
}

/// Writes what the joints from J inward feel of a wrench on link J: column M of the mass matrix, and its mirror image.
template <int J, int M, typename Arm, typename W, typename Matrix>
constexpr void static_mass_column(const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q, const W& wrench,
                                  Matrix& mass) {
  using Scalar = typename Arm::Scalar;
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  if constexpr (Arm::template joint_type<J>() == JointType::kRevolute) {
    mass(J, M) = mass(M, J) = value<Scalar>(dot(frame.axis, wrench.moment));
  } else {
    mass(J, M) = mass(M, J) = value<Scalar>(dot(frame.axis, wrench.force));
  }
  if constexpr (J > 0) {
    static_mass_column<J - 1, M, Arm>(trig, q, wrench_on_parent(frame, wrench), mass);
  }
}

/// Columns of the mass matrix from joint M on.
/// @return all that joint M carries, as one body
template <int M, typename Arm, typename Parameters, typename Matrix>
constexpr auto static_mass_columns(const Parameters& parameters, const JointTrigonometry<Arm>& trig,
                                   const typename Arm::Vector& q, Matrix& mass) {
  using Scalar = typename Arm::Scalar;
  const auto carried = [&] {
    if constexpr (M + 1 < Arm::kNumJoints) {
      return static_mass_columns<M + 1, Arm>(parameters, trig, q, mass);
    } else {
      return CompositeBody<Scalar, Zero>{};
    }
  }();
  const auto link = parameters.template link<M>();
  const auto number = [](const auto& x) { return value<Scalar>(x); };
  // Sums of known ones are no types of this arithmetic: of a body, the mass alone may be a known zero.
  const auto mass_of_link = [&] {
    if constexpr (kIsZero<decltype(link.m)> && kIsZero<decltype(carried.m)>) {
      return Zero{};
    } else {
      return number(link.m);
    }
  }();
  CompositeBody<Scalar, std::remove_const_t<decltype(mass_of_link)>> body{
      mass_of_link,     dense<Scalar>(link.h), number(link.s11), number(link.s12),
      number(link.s22), number(link.s13),      number(link.s23), number(link.s33)};
  if constexpr (M + 1 < Arm::kNumJoints) {
    const auto child = Arm::template frame<M + 1>(trig.joint[M + 1], q[M + 1]);
    add_outboard(child.rotation, child.position, carried, body);
  }
  const auto frame = Arm::template frame<M>(trig.joint[M], q[M]);
  if constexpr (Arm::template joint_type<M>() == JointType::kRevolute) {
    static_mass_column<M, M, Arm>(trig, q, unit_turn(frame.axis, body), mass);
  } else {
    static_mass_column<M, M, Arm>(trig, q, unit_push(frame.axis, body), mass);
  }
  return body;
}

}  // namespace structural

/// Gravity torque g(q) with compile-time geometry.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void gravity_torque(const Parameters& parameters,
                                                    const JointTrigonometry<Arm>& trig,
                                                    const typename Arm::Vector& q,
                                                    typename Arm::Vector& tau) noexcept {
  using namespace structural;
  static_newton_euler<0, Arm>(parameters, trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q, ZeroVector{},
                              ZeroVector{}, tau, NoVisitor{});
}

/// Bias torque: Coriolis, centrifugal and gravity, the torque for q̈ = 0.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void bias_torque(const Parameters& parameters,
                                                 const JointTrigonometry<Arm>& trig,
                                                 const typename Arm::Vector& q,
                                                 const typename Arm::Vector& qd,
                                                 typename Arm::Vector& tau) noexcept {
  using namespace structural;
  static_newton_euler<0, Arm>(parameters, trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q, qd,
                              ZeroVector{}, tau, NoVisitor{});
}

/// Mass matrix of the rigid links (without rotor inertia), compile-time geometry.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void mass_matrix(
    const Parameters& parameters, const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q,
    MassMatrix<typename Arm::Scalar, Arm::kNumJoints>& mass) noexcept {
  structural::static_mass_columns<0, Arm>(parameters, trig, q, mass);
}

/// Gravity torque with run-time geometry.
template <typename Scalar, int N>
inline void gravity_torque(const DynamicArm<Scalar, N>& arm,
                           const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                           const JointVector<Scalar, N>& q, JointVector<Scalar, N>& tau) noexcept {
  const JointVector<Scalar, N> zero = JointVector<Scalar, N>::Zero();
  inverse_dynamics(arm, trig, q, zero, zero, tau);
}

/// Bias torque with run-time geometry.
template <typename Scalar, int N>
inline void bias_torque(const DynamicArm<Scalar, N>& arm,
                        const JointTrigonometry<DynamicArm<Scalar, N>>& trig, const JointVector<Scalar, N>& q,
                        const JointVector<Scalar, N>& qd, JointVector<Scalar, N>& tau) noexcept {
  const JointVector<Scalar, N> zero = JointVector<Scalar, N>::Zero();
  inverse_dynamics(arm, trig, q, qd, zero, tau);
}

/// Mass matrix with run-time geometry, from composite bodies: M(j, m) is what joint j ≤ m feels when joint m alone accelerates
/// all that is outboard of it. M. W. Walker, D. E. Orin, Efficient dynamic computer simulation of robotic mechanisms, J. Dyn.
/// Syst. Meas. Control 104 (1982) 205, method 3.
/// Cost: 6 joints 539 multiplications, 468 additions.
template <typename Scalar, int N>
inline void mass_matrix(const DynamicArm<Scalar, N>& arm,
                        const JointTrigonometry<DynamicArm<Scalar, N>>& trig, const JointVector<Scalar, N>& q,
                        MassMatrix<Scalar, N>& mass) noexcept {
  using namespace structural;
  const HingedArm<Scalar, N>& hinged = arm.hinged();
  std::array<SinCos<Scalar>, N> angles;
  std::array<CompositeBody<Scalar>, N> bodies;
  constexpr Vec3<Int<0>, Int<0>, Int<1>> kAxis{};
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    angles[i] = hinged.angle(j, trig.joint[i]);
    const auto link = hinged.link(j);
    bodies[i] = {link.m, {link.h.x, link.h.y, link.h.z}, link.s11, link.s12, link.s22, link.s13, link.s23, link.s33};
  }
  for (int m = N - 1; m >= 0; --m) {
    const std::size_t body = static_cast<std::size_t>(m);
    Wrench<Dense3<Scalar>, Dense3<Scalar>> wrench;
    const auto set = [&](const auto& w) { wrench = {dense<Scalar>(w.force), dense<Scalar>(w.moment)}; };
    if (hinged.is_revolute(m)) {
      set(unit_turn(kAxis, bodies[body]));
    } else {
      set(unit_push(kAxis, bodies[body]));
    }
    for (int j = m; j >= 0; --j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const Scalar torque = hinged.is_revolute(j) ? wrench.moment.z : wrench.force.z;
      mass(j, m) = torque;
      mass(m, j) = torque;
      if (j > 0) wrench = wrench_on_parent(hinged.rotation(j, angles[i]), hinged.position(j, q[j]), wrench);
    }
    if (m > 0) add_outboard(hinged.rotation(m, angles[body]), hinged.position(m, q[m]), bodies[body], bodies[body - 1]);
  }
}

/// Cholesky factor L of M + diag(extra), written out: bounded, no allocation, and a negative pivot is an answer.
template <typename Scalar, int N>
class MassFactor {
 public:
  /// @param mass   symmetric; its lower triangle is read
  /// @param extra  added to the diagonal, n: rotor inertias
  /// @return kNotPositiveDefinite: the factor before is gone, too
  Status factor(const MassMatrix<Scalar, N>& mass, const JointVector<Scalar, N>& extra) noexcept {
    L_ = mass;
    for (int j = 0; j < N; ++j) {
      Scalar d = L_(j, j) + extra[j];
      for (int k = 0; k < j; ++k) {
        d -= L_(j, k) * L_(j, k);
      }
      if (!(d > Scalar(0))) {
        return Status::kNotPositiveDefinite;
      }
      using std::sqrt;
      const Scalar root = sqrt(d);
      L_(j, j) = root;
      for (int i = j + 1; i < N; ++i) {
        Scalar s = L_(i, j);
        for (int k = 0; k < j; ++k) {
          s -= L_(i, k) * L_(j, k);
        }
        L_(i, j) = s / root;
      }
    }
    return Status::kOk;
  }

  /// The accelerations that a torque gives. Only after factor() has returned kOk. Cost n² multiplications, 2 n divisions.
  JointVector<Scalar, N> solve(const JointVector<Scalar, N>& torque) const noexcept {
    JointVector<Scalar, N> x;
    for (int i = 0; i < N; ++i) {
      Scalar s = torque[i];
      for (int k = 0; k < i; ++k) {
        s -= L_(i, k) * x[k];
      }
      x[i] = s / L_(i, i);
    }
    for (int i = N - 1; i >= 0; --i) {
      Scalar s = x[i];
      for (int k = i + 1; k < N; ++k) {
        s -= L_(k, i) * x[k];
      }
      x[i] = s / L_(i, i);
    }
    return x;
  }

 private:
  MassMatrix<Scalar, N> L_ = MassMatrix<Scalar, N>::Identity();
};

/// Accelerations from torques: solves (M + diag(rotor)) q̈ = τ − bias by Cholesky.
///
/// @param mass   mass matrix at this q
/// @param bias   bias torque, friction included if it is to act
/// @param rotor  reflected rotor inertias, n
/// @param qdd    result
/// @return kNotPositiveDefinite with qdd unchanged
template <typename Scalar, int N>
inline Status forward_dynamics(const MassMatrix<Scalar, N>& mass, const JointVector<Scalar, N>& bias,
                               const JointVector<Scalar, N>& rotor, const JointVector<Scalar, N>& tau,
                               JointVector<Scalar, N>& qdd) noexcept {
  MassFactor<Scalar, N> factor;
  if (const Status status = factor.factor(mass, rotor); status != Status::kOk) {
    return status;
  }
  qdd = factor.solve(tau - bias);
  return Status::kOk;
}

}  // namespace heft
