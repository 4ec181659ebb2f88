/// @file
/// Torque and regressor of an arm that moves at one velocity and is to move at another, as passivity-based controllers need them.
#pragma once

#include <array>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/regressor.hpp"

namespace heft {

/// τ = M(q) q̈_r + C(q, q̇) q̇_r + g(q) with the matrix C of Christoffel's symbols, for which Ṁ − 2 C is skew-symmetric.
///
/// The velocity torque c(v) = C(q, v) v is a quadratic form in v, and Christoffel's symbols are its symmetric bilinear
/// form: C(q, q̇) q̇_r = c((q̇ + q̇_r) / 2) − c((q̇ − q̇_r) / 2). Two passes of the ordinary recursion therefore give it,
/// without making C. Any other factorisation of c(q̇) gives the same torque at q̇_r = q̇, but not passivity.
template <typename Scalar, int N>
class ReferenceDynamics {
 public:
  using Arm = DynamicArm<Scalar, N>;
  using Vector = JointVector<Scalar, N>;
  using Trigonometry = JointTrigonometry<Arm>;
  /// Columns are the ten parameters of a body on the last link, about its frame.
  using LoadRegressor = Eigen::Matrix<Scalar, N, kParametersPerLink>;

  ReferenceDynamics() = default;
  /// @param model  finite numbers, orthonormal rotations, unit axes
  explicit ReferenceDynamics(const ArmModel<Scalar, N>& model) noexcept { set_model(model); }

  /// The same in place, without an arm on the stack.
  void set_model(const ArmModel<Scalar, N>& model) noexcept {
    arm_.set_model(model);
    weightless_.set_model(model);
    weightless_.set_gravity({Scalar(0), Scalar(0), Scalar(0)});
  }

  /// @param gravity  in the base frame, finite [m/s²]
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept { arm_.set_gravity(gravity); }
  const Arm& arm() const noexcept { return arm_; }

  /// @param trig   of q
  /// @param q,qd   joint positions and velocities, n [rad, rad/s; m on a prismatic joint]
  /// @param qd_r   reference velocity, n
  /// @param qdd_r  reference acceleration, n
  /// @return torque of the rigid links, rotors not included, n [N·m, N]
  /// Cost: two inverse dynamics.
  Vector torque(const Trigonometry& trig, const Vector& q, const Vector& qd, const Vector& qd_r,
                const Vector& qdd_r) const noexcept {
    const Vector none = Vector::Zero();
    Vector tau, difference;
    inverse_dynamics(arm_, trig, q, mean(qd, qd_r), qdd_r, tau);
    inverse_dynamics(weightless_, trig, q, half_difference(qd, qd_r), none, difference);
    return tau - difference;
  }

  /// The same torque per unit of each parameter of a body on the last link.
  /// Cost: 6 joints about 1900 multiplications.
  void load_regressor(const Trigonometry& trig, const Vector& q, const Vector& qd, const Vector& qd_r,
                      const Vector& qdd_r, LoadRegressor& Y) const noexcept {
    const Vector none = Vector::Zero();
    LoadRegressor difference;
    last_link_regressor(arm_, trig, q, mean(qd, qd_r), qdd_r, Y);
    last_link_regressor(weightless_, trig, q, half_difference(qd, qd_r), none, difference);
    Y -= difference;
  }

 private:
  static Vector mean(const Vector& a, const Vector& b) noexcept { return Scalar(0.5) * (a + b); }
  static Vector half_difference(const Vector& a, const Vector& b) noexcept { return Scalar(0.5) * (a - b); }

  Arm arm_, weightless_;
};

}  // namespace heft
