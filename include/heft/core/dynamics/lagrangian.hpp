/// @file
/// Generalised momentum and the gradient of the Lagrangian along the joints: dynamics without acceleration.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/link_motion.hpp"

namespace heft {

/// What the rigid bodies' Lagrangian L = ½ q̇ᵀ M(q) q̇ − U(q) says at one instant. Lagrange's equations
/// d/dt momentum − gradient = τ need no acceleration.
template <typename Scalar, int N>
struct LagrangianTerms {
  JointVector<Scalar, N> momentum = JointVector<Scalar, N>::Zero();  ///< ∂L/∂q̇ = M q̇ [N·m·s, N·s]
  /// ∂L/∂q = Cᵀ q̇ − g with the matrix C of Christoffel's symbols, since Ṁ = C + Cᵀ [N·m, N].
  JointVector<Scalar, N> gradient = JointVector<Scalar, N>::Zero();
};

namespace structural {

/// Linear momentum of a link, P = m v + ω × h, and angular momentum about its origin, L = I ω + h × v.
template <typename Link, typename W, typename V>
constexpr auto link_momentum(const Link& link, const W& w, const V& v) {
  const auto about_origin = vec3((link.s22 + link.s33) * w.x - link.s12 * w.y - link.s13 * w.z,
                                 (link.s11 + link.s33) * w.y - link.s12 * w.x - link.s23 * w.z,
                                 (link.s11 + link.s22) * w.z - link.s13 * w.x - link.s23 * w.y);
  return make_wrench(scale(v, link.m) + cross(w, link.h), about_origin + cross(link.h, v));
}

/// Weight of a link at its origin.
/// @param g  gravity in link axes
template <typename Link, typename G>
constexpr auto link_weight(const Link& link, const G& g) {
  return make_wrench(scale(g, link.m), cross(link.h, g));
}

template <typename A, typename B>
constexpr auto sum_of(const A& a, const B& b) {
  return make_wrench(a.force + b.force, a.moment + b.moment);
}

/// Momentum and weight of everything outboard of a joint.
template <typename Momentum, typename Weight>
struct Outboard {
  [[no_unique_address]] Momentum momentum;
  [[no_unique_address]] Weight weight;
};

template <typename Momentum, typename Weight>
constexpr Outboard<Momentum, Weight> make_outboard(const Momentum& momentum, const Weight& weight) {
  return {momentum, weight};
}

/// Turning joint j by δ turns all links outboard of it as one body against the velocity that reaches it from inboard:
/// ∂T/∂q_j = (v_j × S_j) · H_j with the spatial velocity v_j, the joint's axis S_j and the momentum H_j of the links
/// outboard; ∂U/∂q_j is the power of the weight along S_j.
template <typename Scalar, typename Frame, typename W, typename V, typename Outboard>
constexpr void add_joint(const Frame& frame, const W& w, const V& v, const Outboard& outboard,
                         Scalar& momentum, Scalar& gradient) {
  const auto& H = outboard.momentum;
  const auto turned = cross(w, frame.axis);
  const auto of_turn = [&](Scalar& p, Scalar& d) {
    p = value<Scalar>(dot(frame.axis, H.moment));
    d = value<Scalar>(dot(turned, H.moment) + dot(cross(v, frame.axis), H.force) +
                      dot(frame.axis, outboard.weight.moment));
  };
  const auto of_travel = [&](Scalar& p, Scalar& d) {
    p = value<Scalar>(dot(frame.axis, H.force));
    d = value<Scalar>(dot(turned, H.force) + dot(frame.axis, outboard.weight.force));
  };
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      of_turn(momentum, gradient);
    } else {
      of_travel(momentum, gradient);
    }
  } else if (frame.revolute) {
    of_turn(momentum, gradient);
  } else {
    of_travel(momentum, gradient);
  }
}

/// v_j = E (v_p + ω_p × p), plus a q̇ on a prismatic joint.
template <typename Frame, typename W, typename V, typename S>
constexpr auto origin_velocity(const Frame& frame, const W& w_parent, const V& v_parent, const S& qd) {
  const auto carried = frame.rotation * (v_parent + cross(w_parent, frame.position));
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return carried;
    } else {
      return carried + scale(frame.axis, qd);
    }
  } else {
    return carried + scale(frame.axis, frame.revolute ? S(0) : qd);
  }
}

template <int J, typename Arm, typename Parameters, typename W, typename V, typename G>
constexpr auto static_lagrangian(const Parameters& parameters, const JointTrigonometry<Arm>& trig,
                                 const W& w_parent, const V& v_parent, const G& g_parent,
                                 const typename Arm::Vector& q, const typename Arm::Vector& qd,
                                 LagrangianTerms<typename Arm::Scalar, Arm::kNumJoints>& terms) {
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto w = link_velocity(frame, w_parent, qd[J]);
  const auto v = origin_velocity(frame, w_parent, v_parent, qd[J]);
  const auto g = frame.rotation * g_parent;
  const auto link = parameters.template link<J>();
  const auto own = make_outboard(link_momentum(link, w, v), link_weight(link, g));
  const auto all = [&] {
    if constexpr (J + 1 < Arm::kNumJoints) {
      const auto outboard = static_lagrangian<J + 1, Arm>(parameters, trig, w, v, g, q, qd, terms);
      return make_outboard(sum_of(own.momentum, outboard.momentum), sum_of(own.weight, outboard.weight));
    } else {
      return own;
    }
  }();
  add_joint(frame, w, v, all, terms.momentum[J], terms.gradient[J]);
  if constexpr (J > 0) {
    return make_outboard(wrench_on_parent(frame, all.momentum), wrench_on_parent(frame, all.weight));
  } else {
    return make_outboard(make_wrench(Zero3{}, Zero3{}), make_wrench(Zero3{}, Zero3{}));
  }
}

}  // namespace structural

/// Momentum and gradient of the Lagrangian with compile-time geometry. Rotor inertia is not in it.
///
/// @param parameters  ConstantParameters or ReducedParameters of the same description
/// @param trig        of the same q
/// @param q,qd        joint positions and velocities, n [rad, rad/s; m on a prismatic joint]
template <typename Arm, typename Parameters>
requires(Arm::kIsStatic) inline void lagrangian_terms(
    const Parameters& parameters, const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q,
    const typename Arm::Vector& qd, LagrangianTerms<typename Arm::Scalar, Arm::kNumJoints>& terms) noexcept {
  using namespace structural;
  static_lagrangian<0, Arm>(parameters, trig, Zero3{}, Zero3{}, -Arm::base_acceleration(), q, qd, terms);
}

/// The same with run-time geometry.
/// Cost: about that of inverse_dynamics.
template <typename Scalar, int N>
inline void lagrangian_terms(const DynamicArm<Scalar, N>& arm,
                             const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                             const JointVector<Scalar, N>& q, const JointVector<Scalar, N>& qd,
                             LagrangianTerms<Scalar, N>& terms) noexcept {
  using namespace structural;
  using Frame = decltype(arm.frame(0, trig.joint[0], q[0]));
  using V = Dense3<Scalar>;
  std::array<Frame, N> frames;
  std::array<V, N> w, v;
  std::array<Wrench<V, V>, N> momentum, weight;
  const V zero = {Scalar(0), Scalar(0), Scalar(0)};
  V w_parent = zero, v_parent = zero, g = -arm.base_acceleration();
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    frames[i] = arm.frame(j, trig.joint[i], q[j]);
    w[i] = link_velocity(frames[i], w_parent, qd[j]);
    v[i] = origin_velocity(frames[i], w_parent, v_parent, qd[j]);
    g = frames[i].rotation * g;
    const auto link = arm.link(j);
    momentum[i] = link_momentum(link, w[i], v[i]);
    weight[i] = link_weight(link, g);
    w_parent = w[i];
    v_parent = v[i];
  }
  for (int j = N - 1; j >= 0; --j) {
    const std::size_t i = static_cast<std::size_t>(j);
    add_joint(frames[i], w[i], v[i], make_outboard(momentum[i], weight[i]), terms.momentum[j],
              terms.gradient[j]);
    if (j > 0) {
      momentum[i - 1] = sum_of(momentum[i - 1], wrench_on_parent(frames[i], momentum[i]));
      weight[i - 1] = sum_of(weight[i - 1], wrench_on_parent(frames[i], weight[i]));
    }
  }
}

/// Gravity torque of a body on the last link, per unit of what it adds: columns mass [N·m/kg] and first moment x, y, z in
/// the axes and about the origin of the last link frame [N·m/(kg·m)]. The torque that holds it is columns times
/// (m, m c).
template <typename Scalar, int N>
using LoadColumns = Eigen::Matrix<Scalar, N, 4>;

namespace structural {

/// What holds the four unit weights of the last link, about its origin: against gravity g, −m g and −h × g.
template <typename Scalar>
constexpr std::array<Wrench<Dense3<Scalar>, Dense3<Scalar>>, 4> unit_loads(const Dense3<Scalar>& g) {
  using V = Dense3<Scalar>;
  const Scalar none(0);
  const V zero = {none, none, none};
  return {make_wrench(-g, zero), make_wrench(zero, V{none, g.z, -g.y}), make_wrench(zero, V{-g.z, none, g.x}),
          make_wrench(zero, V{g.y, -g.x, none})};
}

template <int J, typename Arm, typename G, typename Columns>
constexpr auto static_load_columns(const JointTrigonometry<Arm>& trig, const G& g_parent,
                                   const typename Arm::Vector& q, Columns& columns) {
  using Scalar = typename Arm::Scalar;
  const auto frame = Arm::template frame<J>(trig.joint[J], q[J]);
  const auto g = frame.rotation * g_parent;
  auto loads = [&] {
    if constexpr (J + 1 < Arm::kNumJoints) {
      return static_load_columns<J + 1, Arm>(trig, g, q, columns);
    } else {
      return unit_loads<Scalar>(dense<Scalar>(g));
    }
  }();
  for (std::size_t c = 0; c < loads.size(); ++c) {
    constexpr bool kRevolute = Arm::template joint_type<J>() == JointType::kRevolute;
    columns(J, static_cast<int>(c)) =
        value<Scalar>(dot(frame.axis, kRevolute ? loads[c].moment : loads[c].force));
    const auto inboard = wrench_on_parent(frame, loads[c]);
    loads[c] = {dense<Scalar>(inboard.force), dense<Scalar>(inboard.moment)};
  }
  return loads;
}

}  // namespace structural

/// Columns of a body on the last link, compile-time geometry. Cost: some 100 multiplications a joint.
template <typename Arm>
requires(Arm::kIsStatic) inline void load_columns(
    const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q,
    LoadColumns<typename Arm::Scalar, Arm::kNumJoints>& columns) noexcept {
  structural::static_load_columns<0, Arm>(trig, -Arm::base_acceleration(), q, columns);
}

/// The same with run-time geometry.
template <typename Scalar, int N>
inline void load_columns(const DynamicArm<Scalar, N>& arm,
                         const JointTrigonometry<DynamicArm<Scalar, N>>& trig,
                         const JointVector<Scalar, N>& q, LoadColumns<Scalar, N>& columns) noexcept {
  using namespace structural;
  using Frame = decltype(arm.frame(0, trig.joint[0], q[0]));
  std::array<Frame, N> frames;
  Dense3<Scalar> g = -arm.base_acceleration();
  for (int j = 0; j < N; ++j) {
    const std::size_t i = static_cast<std::size_t>(j);
    frames[i] = arm.frame(j, trig.joint[i], q[j]);
    g = frames[i].rotation * g;
  }
  auto loads = unit_loads<Scalar>(g);
  for (int j = N - 1; j >= 0; --j) {
    const Frame& frame = frames[static_cast<std::size_t>(j)];
    for (std::size_t c = 0; c < loads.size(); ++c) {
      columns(j, static_cast<int>(c)) = frame.revolute ? loads[c].moment.z : loads[c].force.z;
      loads[c] = wrench_on_parent(frame, loads[c]);
    }
  }
  if (!arm.is_turned(N - 1)) return;
  // The body's first moment is given in the user's axes of the last link: h_inner = T h.
  const auto& T = arm.turn(N - 1);
  for (int i = 0; i < N; ++i) {
    const Scalar x = columns(i, 1), y = columns(i, 2), z = columns(i, 3);
    columns(i, 1) = T[0] * x + T[3] * y + T[6] * z;
    columns(i, 2) = T[1] * x + T[4] * y + T[7] * z;
    columns(i, 3) = T[2] * x + T[5] * y + T[8] * z;
  }
}

}  // namespace heft
