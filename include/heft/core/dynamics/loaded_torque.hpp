/// @file
/// Two torques of one instant from one pass: that of the arm without joint accelerations, and that of the arm with a body
/// on its last link at given ones.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/lagrangian.hpp"
#include "heft/core/dynamics/link_motion.hpp"
#include "heft/core/inertia.hpp"

namespace heft {

namespace structural {

/// Force and moment of a link or body in its motion.
template <typename Link, typename U, typename A>
constexpr auto link_wrench(const Link& link, const U& u, const A& a) {
  return make_wrench(link_force(link, u, a), link_moment(link, u, a));
}

/// axis · moment on a revolute joint, axis · force on a prismatic one.
template <typename Scalar, typename Frame, typename W>
constexpr Scalar along_axis(const Frame& frame, const W& wrench) {
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return value<Scalar>(dot(frame.axis, wrench.moment));
    } else {
      return value<Scalar>(dot(frame.axis, wrench.force));
    }
  } else {
    return frame.revolute ? wrench.moment.z : wrench.force.z;
  }
}

/// What reaches a joint from outboard: without joint accelerations, and what these and the body add.
template <typename Bias, typename Added>
struct TwoWrenches {
  [[no_unique_address]] Bias bias;
  [[no_unique_address]] Added added;
};
/// Compilers before clang 17 do not deduce the members of an aggregate.
template <typename Bias, typename Added>
TwoWrenches(Bias, Added) -> TwoWrenches<Bias, Added>;

/// One link outward, the rest of the arm by recursion, back with both wrenches in parent axes. The motion without joint
/// accelerations is that of Newton and Euler; what joint accelerations add to it (wd_added, a_added) is linear in them and
/// knows neither velocities nor gravity, so that it passes from link to link, and acts on a link, as a velocity does.
template <int J, typename Arm, typename Parameters, typename Body, typename W, typename WD, typename A,
          typename AddedWD, typename AddedA>
constexpr auto static_loaded_torque(const Parameters& parameters, const Body& body,
                                    const JointTrigonometry<Arm>& trig, const W& w_parent,
                                    const WD& wd_parent, const A& at_joint, const AddedWD& wd_added_parent,
                                    const AddedA& a_added_parent, const typename Arm::Vector& q,
                                    const typename Arm::Vector& qd, const typename Arm::Vector& qdd,
                                    typename Arm::Vector& bias, typename Arm::Vector& loaded) {
  using Scalar = typename Arm::Scalar;
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto w = link_velocity(frame, w_parent, qd[J]);
  const auto spin = relative_spin(frame, w, qd[J]);
  const auto wd = link_angular_acceleration(frame, wd_parent, spin, Zero{});
  const auto a = link_acceleration(frame, at_joint, spin, Zero{});
  const auto wd_added = link_velocity(frame, wd_added_parent, qdd[J]);
  const auto a_added = origin_velocity(frame, wd_added_parent, a_added_parent, qdd[J]);
  const auto products = velocity_products(w);
  const auto u = u_matrix(products, wd);
  const auto link = parameters.template link<J>();
  const auto outboard = [&] {
    if constexpr (J + 1 < Arm::kNumJoints) {
      const auto next = Arm::template frame<J + 1>(trig.joint[J + 1], q[J + 1]);
      return static_loaded_torque<J + 1, Arm>(parameters, body, trig, w, wd, a + u_times(u, next.position),
                                              wd_added, a_added, q, qd, qdd, bias, loaded);
    } else {
      return TwoWrenches{make_wrench(Zero3{}, Zero3{}),
                         link_wrench(body, u_matrix(products, wd + wd_added), a + a_added)};
    }
  }();
  const auto all_bias = sum_of(link_wrench(link, u, a), outboard.bias);
  const auto all_added = sum_of(link_momentum(link, wd_added, a_added), outboard.added);
  bias[J] = along_axis<Scalar>(frame, all_bias);
  loaded[J] = bias[J] + along_axis<Scalar>(frame, all_added);
  if constexpr (J > 0) {
    return TwoWrenches{wrench_on_parent(frame, all_bias), wrench_on_parent(frame, all_added)};
  } else {
    return TwoWrenches{make_wrench(Zero3{}, Zero3{}), make_wrench(Zero3{}, Zero3{})};
  }
}

}  // namespace structural

/// Torques of one instant, compile-time geometry.
///
/// @param parameters  ConstantParameters or ReducedParameters of the same description
/// @param trig        of the same q
/// @param base        acceleration of the base that stands for gravity, −g [m/s²]
/// @param q,qd,qdd    n [rad, rad/s, rad/s²; m on a prismatic joint]
/// @param body        on the last link, about its frame; all zero: none
/// @param bias        torque of the arm without the body at q̈ = 0, n [N·m, N]
/// @param loaded      torque of the arm with the body at q̈, n [N·m, N]
/// Cost, Kawasaki and Nishimura's arm: bench/operation_count, watched_sample less control_sample.
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void loaded_torque(
    const Parameters& parameters, const JointTrigonometry<Arm>& trig,
    const structural::Dense3<typename Arm::Scalar>& base, const typename Arm::Vector& q,
    const typename Arm::Vector& qd, const typename Arm::Vector& qdd,
    const InertialParameters<typename Arm::Scalar>& body, typename Arm::Vector& bias,
    typename Arm::Vector& loaded) noexcept {
  using namespace structural;
  static_loaded_torque<0, Arm>(parameters, dense_link(to_pseudo_inertia(body)), trig, Zero3{}, Zero3{}, base,
                               Zero3{}, Zero3{}, q, qd, qdd, bias, loaded);
}

/// The same with run-time geometry and the arm's own gravity.
template <typename Scalar, int N>
inline void loaded_torque(const DynamicArm<Scalar, N>& arm,
                          const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                          const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                          const JointVector<Scalar, N>& qdd, const InertialParameters<Scalar>& body,
                          JointVector<Scalar, N>& bias, JointVector<Scalar, N>& loaded) noexcept {
  using namespace structural;
  using Frame = decltype(arm.frame(0, trig.joint[0], q[0]));
  using V = Dense3<Scalar>;
  std::array<Frame, N> frames;
  std::array<Wrench<V, V>, N> without, added;
  const Scalar none(0);
  V w = {none, none, none}, wd = w, wd_added = w, a_added = w, at_joint = arm.base_acceleration();
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    frames[i] = arm.frame(j, trig.joint[i], q[j]);
    w = link_velocity(frames[i], w, qd[j]);
    const auto spin = relative_spin(frames[i], w, qd[j]);
    wd = link_angular_acceleration(frames[i], wd, spin, none);
    const V a = link_acceleration(frames[i], at_joint, spin, none);
    a_added = origin_velocity(frames[i], wd_added, a_added, qdd[j]);
    wd_added = link_velocity(frames[i], wd_added, qdd[j]);
    const auto products = velocity_products(w);
    const auto u = u_matrix(products, wd);
    const auto link = arm.link(j);
    without[i] = link_wrench(link, u, a);
    added[i] = link_momentum(link, wd_added, a_added);
    if (j + 1 < N) {
      at_joint = a + u_times(u, arm.frame(j + 1, trig.joint[i + 1], q[j + 1]).position);
    } else {
      const auto inner = moved(to_pseudo_inertia(body), arm.turn(j), {none, none, none});
      added[i] =
          sum_of(added[i], link_wrench(dense_link(inner), u_matrix(products, wd + wd_added), a + a_added));
    }
  }
  for (int j = N - 1; j >= 0; --j) {
    const std::size_t i = static_cast<std::size_t>(j);
    bias[j] = along_axis<Scalar>(frames[i], without[i]);
    loaded[j] = bias[j] + along_axis<Scalar>(frames[i], added[i]);
    if (j > 0) {
      without[i - 1] = sum_of(without[i - 1], wrench_on_parent(frames[i], without[i]));
      added[i - 1] = sum_of(added[i - 1], wrench_on_parent(frames[i], added[i]));
    }
  }
}

}  // namespace heft
