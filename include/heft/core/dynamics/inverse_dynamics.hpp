/// @file
/// Inverse dynamics: joint torques from motion by the recursive Newton-Euler method.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/link_motion.hpp"

namespace heft {

/// Sine and cosine of every joint of an arm at one instant, shared by everything computed in a sample.
template <typename Arm>
struct JointTrigonometry {
  static constexpr int kNumJoints = Arm::kNumJoints;
  std::array<SinCos<typename Arm::Scalar>, kNumJoints> joint;
};

/// Sines and cosines of the joint angles.
///
/// @param q  joint angles [rad]; the first is skipped where a compile-time geometry does not need it
/// Cost: one sine and one cosine a joint.
template <typename Arm>
inline JointTrigonometry<Arm> joint_trigonometry(const typename Arm::Vector& q) noexcept {
  using Scalar = typename Arm::Scalar;
  constexpr int kN = Arm::kNumJoints;
  constexpr int kFirst = [] {
    if constexpr (Arm::kIsStatic) {
      return Arm::kFirstAngleIsFree ? 1 : 0;
    } else {
      return 0;
    }
  }();
  JointTrigonometry<Arm> t;
  t.joint[0] = {Scalar(0), Scalar(1)};
  std::array<Scalar, kN> angles;
  for (int j = 0; j < kN; ++j) {
    angles[static_cast<std::size_t>(j)] = q[j];
  }
  sin_cos(angles.data() + kFirst, t.joint.data() + kFirst, kN - kFirst);
  return t;
}

namespace structural {

/// A joint-space vector of known zeros.
struct ZeroVector {};

/// Component J of a joint-space vector, as a type where it is known.
template <int J, typename V>
constexpr auto component(const V& v) {
  return v[J];
}
template <int J>
constexpr Zero component(const ZeroVector&) {
  return {};
}

/// A caller that takes nothing from the recursion on its way out. A visitor answers each link with the visitor of
/// the next, so that it can carry values whose types change from link to link.
struct NoVisitor {
  template <int J, typename Frame, typename U, typename WD, typename A>
  constexpr NoVisitor step(const Frame&, const U&, const WD&, const A&) const {
    return {};
  }
};

/// One link outward, the rest of the arm by recursion, back with the wrench in parent axes. Joint 0 gives
/// none back.
template <int J, typename Arm, typename Parameters, typename W, typename WD, typename A,
          typename Velocity, typename Acceleration, typename Torque, typename Visitor>
constexpr auto static_newton_euler(const Parameters& parameters, const JointTrigonometry<Arm>& trig,
                                   const W& w_parent, const WD& wd_parent, const A& at_joint,
                                   const typename Arm::Vector& q, const Velocity& qd, const Acceleration& qdd,
                                   Torque& tau, const Visitor& visitor) {
  using Scalar = typename Arm::Scalar;
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto w = link_velocity(frame, w_parent, component<J>(qd));
  const auto spin = relative_spin(frame, w, component<J>(qd));
  const auto wd = link_angular_acceleration(frame, wd_parent, spin, component<J>(qdd));
  const auto a = link_acceleration(frame, at_joint, spin, component<J>(qdd));
  const auto u = u_matrix(velocity_products(w), wd);
  const auto link = parameters.template link<J>();
  const auto next_visitor = visitor.template step<J>(frame, u, wd, a);

  const auto outboard = [&] {
    if constexpr (J + 1 < Arm::kNumJoints) {
      const auto next = Arm::template frame<J + 1>(trig.joint[J + 1], q[J + 1]);
      return static_newton_euler<J + 1, Arm>(parameters, trig, w, wd, a + u_times(u, next.position), q, qd,
                                             qdd, tau, next_visitor);
    } else {
      return make_wrench(Zero3{}, Zero3{});
    }
  }();
  constexpr bool kRevolute = Arm::template joint_type<J>() == JointType::kRevolute;
  if constexpr (J == 0) {
    if constexpr (kRevolute) {
      tau[J] = value<Scalar>(moment_about(frame.axis, link, u, a) + dot(frame.axis, outboard.moment));
    } else {
      tau[J] = value<Scalar>(dot(frame.axis, link_force(link, u, a) + outboard.force));
    }
    return make_wrench(Zero3{}, Zero3{});
  } else {
    const auto force = link_force(link, u, a) + outboard.force;
    const auto moment = link_moment(link, u, a) + outboard.moment;
    if constexpr (kRevolute) {
      tau[J] = value<Scalar>(dot(frame.axis, moment));
    } else {
      tau[J] = value<Scalar>(dot(frame.axis, force));
    }
    return wrench_on_parent(frame, make_wrench(force, moment));
  }
}

}  // namespace structural

/// Joint torques of the rigid arm with compile-time geometry.
///
/// @tparam Arm         StaticArm
/// @param parameters   ConstantParameters or ReducedParameters of the same description
/// @param trig         of the same q
/// @param q,qd,qdd     joint positions, velocities, accelerations, n [rad, rad/s, rad/s²; m on a prismatic joint]
/// @param tau          joint torques, n [N·m; N], along positive q, gravity included, friction not
/// @param visitor      shares the forward pass, see structural::NoVisitor
/// Cost, Kawasaki and Nishimura's arm: bench/operation_count prints it.
template <typename Arm, typename Parameters, typename Visitor = structural::NoVisitor>
requires(Arm::kIsStatic) inline void inverse_dynamics(
    const Parameters& parameters, const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q,
    const typename Arm::Vector& qd, const typename Arm::Vector& qdd, typename Arm::Vector& tau,
    const Visitor& visitor = Visitor{}) noexcept {
  using namespace structural;
  // The base does not turn, so a_0 + U_0 p = a_0.
  static_newton_euler<0, Arm>(parameters, trig, Zero3{}, Zero3{}, Arm::base_acceleration(), q, qd, qdd,
                              tau, visitor);
}

/// Joint torques of the rigid arm with run-time geometry. Arguments as above.
/// Cost: 6 joints 527 multiplications, 463 additions.
template <typename Scalar, int N>
inline void inverse_dynamics(const DynamicArm<Scalar, N>& arm,
                             const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                             const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                             const JointVector<Scalar, N>& qdd, JointVector<Scalar, N>& tau) noexcept {
  using namespace structural;
  using V = Dense3<Scalar>;
  const HingedArm<Scalar, N>& hinged = arm.hinged();
  std::array<SinCos<Scalar>, N> angles;
  std::array<Wrench<V, V>, N> wrench;
  Scalar along_first{0};  // what the first joint asks of its wrench

  V w = {Scalar(0), Scalar(0), Scalar(0)}, wd = w;
  V at_joint = hinged.base_acceleration();
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    angles[i] = hinged.angle(j, trig.joint[i]);
    const auto rotation = hinged.rotation(j, angles[i]);
    V a = rotation * at_joint;
    if (j > 0) {  // The base is at rest.
      w = rotation * w;
      wd = rotation * wd;
    }
    add_joint_motion(hinged.is_revolute(j), qd[j], qdd[j], w, wd, a);
    const auto u = u_matrix(velocity_products(w), wd);
    const auto link = hinged.link(j);
    if (j > 0) {
      wrench[i] = {link_force(link, u, a), link_moment(link, u, a)};
    } else {
      along_first = hinged.is_revolute(0) ? link_moment_z(link, u, a) : link_force(link, u, a).z;
    }
    if (j + 1 < N) {
      at_joint = a + u_times(u, hinged.position(j + 1, q[j + 1]));
    }
  }
  for (int j = N - 1; j > 0; --j) {
    const std::size_t i = static_cast<std::size_t>(j);
    tau[j] = hinged.is_revolute(j) ? wrench[i].moment.z : wrench[i].force.z;
    const auto inboard = wrench_on_parent(hinged.rotation(j, angles[i]), hinged.position(j, q[j]), wrench[i]);
    if (j > 1) {
      wrench[i - 1].force = wrench[i - 1].force + inboard.force;
      wrench[i - 1].moment = wrench[i - 1].moment + inboard.moment;
    } else {
      along_first = along_first + (hinged.is_revolute(0) ? inboard.moment.z : inboard.force.z);
    }
  }
  tau[0] = along_first;
}

/// Joint torques of the rigid arm with run-time geometry; computes sines and cosines itself.
template <typename Scalar, int N>
inline JointVector<Scalar, N> inverse_dynamics(const DynamicArm<Scalar, N>& arm,
                                               const JointVector<Scalar, N>& q,
                                               const JointVector<Scalar, N>& qd,
                                               const JointVector<Scalar, N>& qdd) noexcept {
  JointVector<Scalar, N> tau;
  inverse_dynamics(arm, joint_trigonometry<DynamicArm<Scalar, N>>(q), q, qd, qdd, tau);
  return tau;
}

/// The same for compile-time geometry.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline typename Arm::Vector
    inverse_dynamics(const Parameters& parameters, const typename Arm::Vector& q,
                     const typename Arm::Vector& qd, const typename Arm::Vector& qdd) noexcept {
  typename Arm::Vector tau;
  inverse_dynamics<Arm>(parameters, joint_trigonometry<Arm>(q), q, qd, qdd, tau);
  return tau;
}

}  // namespace heft
