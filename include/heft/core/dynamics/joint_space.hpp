/// @file
/// Gravity and bias torques, mass matrix and forward dynamics.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Joint-space mass matrix M(q), symmetric [kg·m², kg, kg·m].
template <typename Scalar, int N>
using MassMatrix = Eigen::Matrix<Scalar, N, N>;

namespace structural {

/// Writes a column of the mass matrix below and on the diagonal, and its mirror image.
template <int M, typename Matrix>
struct MassColumn {
  Matrix& mass;
  struct Entry {
    Matrix& mass;
    int row;
    template <typename Scalar>
    constexpr void operator=(const Scalar& value) const {
      mass(row, M) = value;
      mass(M, row) = value;
    }
  };
  constexpr Entry operator[](int row) const { return {mass, row}; }
};

template <int M, typename Arm, typename Parameters, typename Matrix>
constexpr void static_mass_columns(const Parameters& parameters, const JointTrigonometry<Arm>& trig,
                                   const typename Arm::Vector& q, Matrix& mass) {
  MassColumn<M, Matrix> column{mass};
  // Torques for q̈ = e_M at rest without gravity; joints before M are at rest.
  static_newton_euler<M, M, Arm>(parameters, trig, Zero3{}, Zero3{}, Zero3{}, q, ZeroVector{},
                                 UnitVector<M>{}, column, NoVisitor{});
  if constexpr (M + 1 < Arm::kNumJoints) {
    static_mass_columns<M + 1, Arm>(parameters, trig, q, mass);
  }
}

}  // namespace structural

/// Gravity torque g(q) with compile-time geometry.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void gravity_torque(const Parameters& parameters,
                                                    const JointTrigonometry<Arm>& trig,
                                                    const typename Arm::Vector& q,
                                                    typename Arm::Vector& tau) noexcept {
  using namespace structural;
  static_newton_euler<0, 0, Arm>(parameters, trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q,
                                 ZeroVector{}, ZeroVector{}, tau, NoVisitor{});
}

/// Bias torque: Coriolis, centrifugal and gravity, the torque for q̈ = 0.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void bias_torque(const Parameters& parameters,
                                                 const JointTrigonometry<Arm>& trig,
                                                 const typename Arm::Vector& q,
                                                 const typename Arm::Vector& qd,
                                                 typename Arm::Vector& tau) noexcept {
  using namespace structural;
  static_newton_euler<0, 0, Arm>(parameters, trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q, qd,
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

namespace structural {

/// Links outboard of a joint as one body: mass, first moment h and second moment Σ about the origin of the joint's frame, in its
/// axes.
template <typename Scalar>
struct CompositeBody {
  Scalar m;
  Dense3<Scalar> h;
  Scalar s11, s12, s22, s13, s23, s33;

  /// Force and moment for a unit acceleration of the joint from rest, without gravity. The joint's axis is z:
  /// f = z × h, n = ∫ r × (z × r) dm about it, f = m z, n = h × z along it.
  Wrench<Dense3<Scalar>, Dense3<Scalar>> unit_wrench(bool revolute) const {
    const Scalar zero{0};
    if (revolute) return {{-h.y, h.x, zero}, {-s13, -s23, s11 + s22}};
    return {{zero, zero, m}, {h.y, -h.x, zero}};
  }
};

/// Adds what is outboard of a joint to its parent's link. With h' = Eᵀ h and u = h' + m p / 2:
/// m, h' + m p, Eᵀ Σ E + u pᵀ + p uᵀ.
template <typename Scalar>
constexpr void add_outboard(const DynamicFrame<Scalar>& frame, const CompositeBody<Scalar>& child, CompositeBody<Scalar>& parent) {
  const auto& E = frame.rotation;
  const auto& p = frame.position;
  const Dense3<Scalar> turned = transpose_times(E, child.h);
  const Dense3<Scalar> half = scale(p, child.m * Scalar(0.5));
  const Dense3<Scalar> u = turned + half;
  // Rows of Σ E.
  const Dense3<Scalar> b0 = scale(E.row0, child.s11) + scale(E.row1, child.s12) + scale(E.row2, child.s13);
  const Dense3<Scalar> b1 = scale(E.row0, child.s12) + scale(E.row1, child.s22) + scale(E.row2, child.s23);
  const Dense3<Scalar> b2 = scale(E.row0, child.s13) + scale(E.row1, child.s23) + scale(E.row2, child.s33);
  const Scalar xx = u.x * p.x, yy = u.y * p.y, zz = u.z * p.z;
  parent.m = parent.m + child.m;
  parent.h = parent.h + u + half;
  parent.s11 = parent.s11 + (E.row0.x * b0.x + E.row1.x * b1.x + E.row2.x * b2.x) + (xx + xx);
  parent.s12 = parent.s12 + (E.row0.x * b0.y + E.row1.x * b1.y + E.row2.x * b2.y) + (u.x * p.y + u.y * p.x);
  parent.s22 = parent.s22 + (E.row0.y * b0.y + E.row1.y * b1.y + E.row2.y * b2.y) + (yy + yy);
  parent.s13 = parent.s13 + (E.row0.x * b0.z + E.row1.x * b1.z + E.row2.x * b2.z) + (u.x * p.z + u.z * p.x);
  parent.s23 = parent.s23 + (E.row0.y * b0.z + E.row1.y * b1.z + E.row2.y * b2.z) + (u.y * p.z + u.z * p.y);
  parent.s33 = parent.s33 + (E.row0.z * b0.z + E.row1.z * b1.z + E.row2.z * b2.z) + (zz + zz);
}

}  // namespace structural

/// Mass matrix with run-time geometry, from composite bodies: M(j, m) is what joint j ≤ m feels when joint m alone accelerates
/// all that is outboard of it. M. W. Walker, D. E. Orin, Efficient dynamic computer simulation of robotic mechanisms, J. Dyn.
/// Syst. Meas. Control 104 (1982) 205, method 3.
/// Cost: 6 joints 767 multiplications, 632 additions.
template <typename Scalar, int N>
inline void mass_matrix(const DynamicArm<Scalar, N>& arm,
                        const JointTrigonometry<DynamicArm<Scalar, N>>& trig, const JointVector<Scalar, N>& q,
                        MassMatrix<Scalar, N>& mass) noexcept {
  using namespace structural;
  std::array<DynamicFrame<Scalar>, N> frames;
  std::array<CompositeBody<Scalar>, N> bodies;
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    arm.put_frame(j, trig.joint[i], q[j], frames[i]);
    const auto link = arm.link(j);
    bodies[i] = {link.m, {link.h.x, link.h.y, link.h.z}, link.s11, link.s12, link.s22, link.s13, link.s23, link.s33};
  }
  for (int m = N - 1; m >= 0; --m) {
    const std::size_t body = static_cast<std::size_t>(m);
    auto wrench = bodies[body].unit_wrench(frames[body].revolute);
    for (int j = m; j >= 0; --j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const Scalar torque = frames[i].revolute ? wrench.moment.z : wrench.force.z;
      mass(j, m) = torque;
      mass(m, j) = torque;
      if (j > 0) wrench = wrench_on_parent(frames[i], wrench);
    }
    if (m > 0) add_outboard(frames[body], bodies[body], bodies[body - 1]);
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
