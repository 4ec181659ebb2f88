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

/// Mass matrix with run-time geometry: column by column, the torques for q̈ = e_m at rest without gravity.
/// Cost: n (n + 1) / 2 link steps.
template <typename Scalar, int N>
inline void mass_matrix(const DynamicArm<Scalar, N>& arm,
                        const JointTrigonometry<DynamicArm<Scalar, N>>& trig, const JointVector<Scalar, N>& q,
                        MassMatrix<Scalar, N>& mass) noexcept {
  using namespace structural;
  using V = Dense3<Scalar>;
  using Frame = decltype(arm.frame(0, trig.joint[0], q[0]));
  std::array<Frame, N> frames;
  for (int j = 0; j < N; ++j) {
    frames[static_cast<std::size_t>(j)] = arm.frame(j, trig.joint[static_cast<std::size_t>(j)], q[j]);
  }
  const auto at_rest = velocity_products(Zero3{});
  std::array<Wrench<V, V>, N> wrench;
  for (int m = 0; m < N; ++m) {
    const V zero = {Scalar(0), Scalar(0), Scalar(0)};
    V wd = zero;
    V a = zero;
    for (int j = m; j < N; ++j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const Scalar qdd = j == m ? Scalar(1) : Scalar(0);
      // The parent of joint m is at rest, so its acceleration at the joint is zero.
      const V at_joint = j == m ? zero : a + cross(wd, frames[i].position);
      const V wd_parent = wd;
      wd = link_angular_acceleration(frames[i], wd_parent, zero, qdd);
      a = link_acceleration(frames[i], at_joint, zero, qdd);
      const auto u = u_matrix(at_rest, wd);
      const auto link = arm.link(j);
      wrench[i] = {link_force(link, u, a), link_moment(link, u, a)};
    }
    for (int j = N - 1; j >= m; --j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const Scalar torque = frames[i].revolute ? wrench[i].moment.z : wrench[i].force.z;
      mass(j, m) = torque;
      mass(m, j) = torque;
      if (j > m) {
        const auto inboard = wrench_on_parent(frames[i], wrench[i]);
        wrench[i - 1].force = wrench[i - 1].force + inboard.force;
        wrench[i - 1].moment = wrench[i - 1].moment + inboard.moment;
      }
    }
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
