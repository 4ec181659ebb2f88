/// @file
/// Process model of the Kalman filters: an arm whose friction drifts and which may carry an unknown load.
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/dynamics/torque_derivatives.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Where each unknown is in the state [q, q̇, Coulomb, viscous, load].
template <int N, int Load>
struct DriftLayout {
  static_assert(Load == 0 || Load == 1 || Load == 4 || Load == 10,
                "a load's mass, mass and first moment, or all ten inertial parameters");
  static constexpr int kPosition = 0;
  static constexpr int kVelocity = N;
  static constexpr int kCoulomb = 2 * N;
  static constexpr int kViscous = 3 * N;
  static constexpr int kLoad = 4 * N;  ///< in the order of InertialParameters
  static constexpr int kMechanical = 2 * N;
  static constexpr int kParameters = 2 * N + Load;
  static constexpr int kStates = 4 * N + Load;
};

/// (M + rotors) q̈ = τ − h(q, q̇) − F sign(q̇) − d q̇ − offset over one step, with its derivatives. M and h include the load.
///
/// Friction is taken at the end of the step along the chord of its curve: (M + rotors + Δt D) a = τ − h − friction(q̇), with
/// D = d + F (sign(q̇ₑ) − sign(q̇)) / (q̇ₑ − q̇) and q̇ₑ the velocity that an explicit step would reach. A joint of small
/// inertia then comes to rest instead of swinging about zero, however stiff its friction; while it slides in one direction
/// the step is the explicit one. Gravity and inertia are taken in the middle of the way, q + ½ Δt q̇.
///
/// @tparam Load  number of unknown inertial parameters of a load at the last link: 0; 1: mass; 4: first moment as well; 10
template <typename Scalar, int N, int Load>
class DriftingArm {
 public:
  using Layout = DriftLayout<N, Load>;
  using Vector = JointVector<Scalar, N>;
  using State = std::array<Scalar, static_cast<std::size_t>(Layout::kStates)>;
  using Mechanics = Eigen::Matrix<Scalar, 2 * N, 1>;  ///< [q, q̇]
  using Transition = Eigen::Matrix<Scalar, 2 * N, Layout::kStates>;
  using Gain = Eigen::Matrix<Scalar, 2 * N, N>;

  /// @param sign_width  of the Coulomb sign, > 0, see velocity_sign
  void set_model(const ArmModel<Scalar, N>& model, const Scalar& sign_width) noexcept {
    arm_.set_model(model);
    last_link_ = model.links[N - 1];
    sign_width_ = sign_width;
    for (int i = 0; i < N; ++i) {
      rotor_[i] = model.actuation[static_cast<std::size_t>(i)].rotor_inertia;
      offset_[i] = model.actuation[static_cast<std::size_t>(i)].friction_offset;
    }
  }

  /// One step of q and q̇; the parameters stay.
  /// @param tau   mean torque over the step, n [N·m, N]
  /// @param dt    > 0 [s]
  /// @param change  of [q, q̇]; a change, since in float its digits would be lost in the sum
  /// @return kNotPositiveDefinite: no arm has these links
  /// Cost: one inverse dynamics, one mass matrix, two Cholesky factors; 6 joints about 1300 multiplications.
  Status step(const State& x, const Vector& tau, const Scalar& dt, Mechanics& change) noexcept {
    if constexpr (Load > 0) {
      InertialParameters<Scalar> link = last_link_;
      for (std::size_t k = 0; k < static_cast<std::size_t>(Load); ++k) {
        link[k] += x[static_cast<std::size_t>(Layout::kLoad) + k];
      }
      arm_.set_link(N - 1, link);
    }
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      v_[i] = x[Layout::kVelocity + k];
      q_[i] = x[k] + Scalar(0.5) * dt * v_[i];
    }
    trig_ = joint_trigonometry<DynamicArm<Scalar, N>>(q_);
    MassMatrix<Scalar, N> mass;
    mass_matrix(arm_, trig_, q_, mass);
    Vector bias;
    bias_torque(arm_, trig_, q_, v_, bias);
    Vector net;
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      sign_[i] = velocity_sign(v_[i], sign_width_);
      net[i] = tau[i] - bias[i] - x[Layout::kCoulomb + k] * sign_[i] - x[Layout::kViscous + k] * v_[i] -
               offset_[i];
    }
    if (const Status status = factor_or_go_without_load(mass); status != Status::kOk) {
      return status;
    }
    const Vector explicit_velocity = v_ + dt * factor_.solve(net);
    Vector diagonal;
    for (int i = 0; i < N; ++i) {
      const std::size_t k = static_cast<std::size_t>(i);
      const Scalar coulomb = x[Layout::kCoulomb + k], push = net[i] + coulomb * sign_[i];
      chord_[i] = chord(i, explicit_velocity[i], push < coulomb && -push < coulomb);
      // A negative estimate must not feed the motion.
      damping_[i] = not_negative(x[Layout::kViscous + k]) + not_negative(x[Layout::kCoulomb + k]) * chord_[i];
      diagonal[i] = rotor_[i] + dt * damping_[i];
      uncertain_[i] = not_negative(x[Layout::kCoulomb + k]) * (Scalar(1) - sign_[i] * sign_[i]);
    }
    if (const Status status = factor_.factor(mass, diagonal); status != Status::kOk) {
      return status;
    }
    a_ = factor_.solve(net);
    for (int i = 0; i < N; ++i) {
      change[N + i] = dt * a_[i];
      change[i] = dt * (v_[i] + Scalar(0.5) * change[N + i]);
    }
    return Status::kOk;
  }

  /// Derivative of the last step by the state, exact but for the chord, which is held.
  /// Cost: torque_derivatives, the load's columns of the regressor, 3 n + Load solutions; 6 joints about 5000 multiplications.
  void transition(const Scalar& dt, Transition& A) const noexcept {
    TorqueDerivatives<Scalar, N> d;
    torque_derivatives(arm_, trig_, q_, v_, a_, d);
    const Scalar half = Scalar(0.5) * dt;
    for (int j = 0; j < N; ++j) {
      const Vector unit = factor_.solve(Vector::Unit(j));
      const Vector by_position = factor_.solve(-d.dq.col(j));
      const Vector by_velocity = factor_.solve(-d.dqd.col(j)) + half * by_position - damping_[j] * unit;
      put(A, j, by_position, dt);
      A(j, j) += Scalar(1);
      put(A, N + j, by_velocity, dt);
      A(N + j, N + j) += Scalar(1);
      A(j, N + j) += dt;
      put(A, Layout::kCoulomb + j, -(sign_[j] + chord_[j] * dt * a_[j]) * unit, dt);
      put(A, Layout::kViscous + j, -(v_[j] + dt * a_[j]) * unit, dt);
    }
    if constexpr (Load > 0) {
      Eigen::Matrix<Scalar, N, kParametersPerLink> Y;
      last_link_regressor(arm_, trig_, q_, v_, a_, Y);
      for (int k = 0; k < Load; ++k) {
        put(A, Layout::kLoad + k, factor_.solve(-Y.col(k)), dt);
      }
    }
  }

  /// Derivative of the last step by the torque. Cost n³.
  void gain(const Scalar& dt, Gain& G) const noexcept {
    for (int j = 0; j < N; ++j) {
      put(G, j, factor_.solve(Vector::Unit(j)), dt);
    }
  }

  /// Friction that the velocity of the last step leaves open [N·m, N]: F (1 − sign²), all of it at rest, where a joint that
  /// sticks takes up any torque; nothing beyond three widths of the sign.
  const Vector& uncertain_friction() const noexcept { return uncertain_; }

 private:
  // A sigma point, or an estimate on its way, may be a load of negative mass that no mass matrix survives: it then acts by its weight
  // only.
  Status factor_or_go_without_load(MassMatrix<Scalar, N>& mass) noexcept {
    const Status status = factor_.factor(mass, rotor_);
    if (Load == 0 || status == Status::kOk) {
      return status;
    }
    arm_.set_link(N - 1, last_link_);
    mass_matrix(arm_, trig_, q_, mass);
    return factor_.factor(mass, rotor_);
  }

  static Scalar not_negative(const Scalar& v) noexcept { return v > Scalar(0) ? v : Scalar(0); }

  // Reached by an explicit step, which a joint of small inertia takes far beyond standstill. From there the chord would be too flat
  // to stop the joint: it ends at most one width beyond the present speed, which leaves half a width of overshoot. Where friction
  // holds what pushes the joint, it ends where friction is developed in full at the latest: a joint that creeps goes on creeping.
  Scalar chord(int i, Scalar reached, bool held) const noexcept {
    // From standstill the joint stops on its way to either side.
    const bool down = v_[i] > Scalar(0) || (!(v_[i] < Scalar(0)) && reached < Scalar(0));
    const Scalar back = down ? -v_[i] - sign_width_ : -v_[i] + sign_width_;
    reached = down == (reached < back) ? back : reached;
    const Scalar full = Scalar(3) * sign_width_;
    reached = !held ? reached : reached > full ? full : reached < -full ? -full : reached;
    const Scalar way = reached - v_[i];
    const Scalar least = static_cast<Scalar>(1e-3) * sign_width_;
    return way > least || way < -least ? (velocity_sign(reached, sign_width_) - sign_[i]) / way
                                       : velocity_sign_slope(v_[i], sign_width_);
  }

  // Column c from the derivative of the acceleration.
  template <typename Matrix>
  static void put(Matrix& A, int c, const Vector& acceleration, const Scalar& dt) noexcept {
    for (int i = 0; i < N; ++i) {
      A(N + i, c) = dt * acceleration[i];
      A(i, c) = Scalar(0.5) * dt * A(N + i, c);
    }
  }

  DynamicArm<Scalar, N> arm_;
  InertialParameters<Scalar> last_link_{};
  Vector rotor_ = Vector::Zero(), offset_ = Vector::Zero();
  Scalar sign_width_{1};
  // Of the last step.
  JointTrigonometry<DynamicArm<Scalar, N>> trig_{};
  Vector q_ = Vector::Zero(), v_ = Vector::Zero(), a_ = Vector::Zero();
  Vector sign_ = Vector::Zero(), chord_ = Vector::Zero(), damping_ = Vector::Zero(),
         uncertain_ = Vector::Zero();
  MassFactor<Scalar, N> factor_;
};

}  // namespace heft
