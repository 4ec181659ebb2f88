/// @file
/// The recursive Newton-Euler steps from one link to the next, written once for both kinds of geometry.
///
/// Vectors are in link axes, at the link-frame origin, which lies on the joint axis. Symbols: w angular
/// velocity, wd angular acceleration, a linear acceleration of the origin with gravity subtracted. The
/// numbers of equations are those of Luh, Walker and Paul (1980); second-moment form: pseudo_inertia.md.
#pragma once

#include <type_traits>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/structural.hpp"

namespace heft::structural {

/// Products of the components of w: the velocity half of U = [wd]× + [w]×².
template <typename XX, typename YY, typename ZZ, typename XY, typename XZ, typename YZ>
struct VelocityProducts {
  [[no_unique_address]] XX xx;
  [[no_unique_address]] YY yy;
  [[no_unique_address]] ZZ zz;
  [[no_unique_address]] XY xy;
  [[no_unique_address]] XZ xz;
  [[no_unique_address]] YZ yz;
};

template <typename XX, typename YY, typename ZZ, typename XY, typename XZ, typename YZ>
constexpr VelocityProducts<XX, YY, ZZ, XY, XZ, YZ> make_products(const XX& xx, const YY& yy, const ZZ& zz,
                                                                 const XY& xy, const XZ& xz, const YZ& yz) {
  return {xx, yy, zz, xy, xz, yz};
}

template <typename W>
constexpr auto velocity_products(const W& w) {
  return make_products(w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z);
}

/// Product with a factor that is only computed when the other factor is not the known zero.
template <typename Factor, typename T>
constexpr auto lazy_times(Factor factor, const T& t) {
  if constexpr (kIsZero<T>) {
    return Zero{};
  } else {
    return factor() * t;
  }
}

/// U = [wd]× + [w]×² (U v is the acceleration of a point v from the origin against that of the origin).
/// Off-diagonal entries; the diagonal is −(yy + zz), −(xx + zz), −(xx + yy) and made where it is wanted.
template <typename Products, typename U12, typename U13, typename U21, typename U23, typename U31,
          typename U32>
struct UMatrix {
  [[no_unique_address]] Products v;
  [[no_unique_address]] U12 u12;
  [[no_unique_address]] U13 u13;
  [[no_unique_address]] U21 u21;
  [[no_unique_address]] U23 u23;
  [[no_unique_address]] U31 u31;
  [[no_unique_address]] U32 u32;
};

template <typename Products, typename U12, typename U13, typename U21, typename U23, typename U31,
          typename U32>
constexpr UMatrix<Products, U12, U13, U21, U23, U31, U32> make_u(const Products& v, const U12& u12,
                                                                 const U13& u13, const U21& u21,
                                                                 const U23& u23, const U31& u31,
                                                                 const U32& u32) {
  return {v, u12, u13, u21, u23, u31, u32};
}

template <typename Products, typename WD>
constexpr auto u_matrix(const Products& p, const WD& wd) {
  return make_u(p, p.xy - wd.z, p.xz + wd.y, p.xy + wd.z, p.yz - wd.x, p.xz - wd.y, p.yz + wd.x);
}

/// U v.
template <typename U, typename V>
constexpr auto u_times(const U& u, const V& v) {
  return vec3(u.u12 * v.y + u.u13 * v.z - lazy_times([&] { return u.v.yy + u.v.zz; }, v.x),
              u.u21 * v.x + u.u23 * v.z - lazy_times([&] { return u.v.xx + u.v.zz; }, v.y),
              u.u31 * v.x + u.u32 * v.y - lazy_times([&] { return u.v.xx + u.v.yy; }, v.z));
}

/// True for a joint of this frame that turns. A compile-time joint answers with a constant.
template <typename Frame>
constexpr bool is_revolute(const Frame& frame) {
  if constexpr (requires { Frame::type; }) {
    return Frame::type == JointType::kRevolute;
  } else {
    return frame.revolute;
  }
}

/// ω_j = E ω_p + a q̇ (revolute), E ω_p (prismatic).
template <typename Frame, typename W, typename S>
constexpr auto link_velocity(const Frame& frame, const W& w_parent, const S& qd) {
  const auto carried = frame.rotation * w_parent;
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return carried + scale(frame.axis, qd);
    } else {
      return carried;
    }
  } else {
    return carried + scale(frame.axis, frame.revolute ? qd : S(0));
  }
}

/// Velocity part of the joint's relative motion: ω_j × a q̇, added to ω̇ of a revolute joint; twice it is the
/// Coriolis acceleration of a prismatic one. (ω_j × a = E ω_p × a, since both differ by a multiple of a.)
template <typename Frame, typename W, typename S>
constexpr auto relative_spin(const Frame& frame, const W& w, const S& qd) {
  return scale(cross(w, frame.axis), qd);
}

/// ω̇_j = E ω̇_p + ω_j × a q̇ + a q̈ (revolute), E ω̇_p (prismatic).
template <typename Frame, typename WD, typename Spin, typename S>
constexpr auto link_angular_acceleration(const Frame& frame, const WD& wd_parent, const Spin& spin,
                                         const S& qdd) {
  const auto carried = frame.rotation * wd_parent;
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return carried + spin + scale(frame.axis, qdd);
    } else {
      return carried;
    }
  } else {
    using Sum = Dense3<std::remove_cvref_t<decltype(carried.x)>>;
    return frame.revolute ? Sum(carried + spin + scale(frame.axis, qdd)) : Sum(carried);
  }
}

/// a_j = E (a_p + U_p p) (revolute), plus 2 ω × a q̇ + a q̈ (prismatic).
/// @param at_joint  a_p + U_p p, acceleration of the joint point on the parent, parent axes
template <typename Frame, typename A, typename Spin, typename S>
constexpr auto link_acceleration(const Frame& frame, const A& at_joint, const Spin& spin, const S& qdd) {
  const auto carried = frame.rotation * at_joint;
  if constexpr (requires { Frame::type; }) {
    if constexpr (Frame::type == JointType::kRevolute) {
      return carried;
    } else {
      return carried + spin + spin + scale(frame.axis, qdd);
    }
  } else {
    using Sum = Dense3<std::remove_cvref_t<decltype(carried.x)>>;
    return frame.revolute ? Sum(carried) : Sum(carried + scale(spin, S(2)) + scale(frame.axis, qdd));
  }
}

/// The same three for an axis z that is known at run time: what the joint adds to the motion carried from its parent.
/// (One branch, and nothing is copied.)
/// @param w,wd,a  E ω_p, E ω̇_p and E (a_p + U_p p); then those of the link
template <typename Scalar>
constexpr void add_joint_motion(bool revolute, const Scalar& qd, const Scalar& qdd, Dense3<Scalar>& w, Dense3<Scalar>& wd,
                                Dense3<Scalar>& a) {
  const Scalar spin_x = w.y * qd, spin_y = -w.x * qd;
  if (revolute) {
    w.z = w.z + qd;
    wd = {wd.x + spin_x, wd.y + spin_y, wd.z + qdd};
  } else {
    a = {a.x + Scalar(2) * spin_x, a.y + Scalar(2) * spin_y, a.z + qdd};
  }
}

/// f = m a + U h.
template <typename Link, typename U, typename A>
constexpr auto link_force(const Link& link, const U& u, const A& a) {
  return scale(a, link.m) + u_times(u, link.h);
}

// n = ∫ r × (U r) dm + h × a. With U in place of the integral's kernel each component is a row of U against
// a column of Σ less the transposed pair; the diagonal enters by its differences.

template <typename Link, typename U, typename A>
constexpr auto link_moment_x(const Link& link, const U& u, const A& a) {
  return u.u31 * link.s12 + u.u32 * link.s22 + lazy_times([&] { return u.v.zz - u.v.yy; }, link.s23) -
         u.u21 * link.s13 - u.u23 * link.s33 + (link.h.y * a.z - link.h.z * a.y);
}

template <typename Link, typename U, typename A>
constexpr auto link_moment_y(const Link& link, const U& u, const A& a) {
  return lazy_times([&] { return u.v.xx - u.v.zz; }, link.s13) + u.u12 * link.s23 + u.u13 * link.s33 -
         u.u31 * link.s11 - u.u32 * link.s12 + (link.h.z * a.x - link.h.x * a.z);
}

template <typename Link, typename U, typename A>
constexpr auto link_moment_z(const Link& link, const U& u, const A& a) {
  return u.u21 * link.s11 + lazy_times([&] { return u.v.yy - u.v.xx; }, link.s12) + u.u23 * link.s13 -
         u.u12 * link.s22 - u.u13 * link.s23 + (link.h.x * a.y - link.h.y * a.x);
}

template <typename Link, typename U, typename A>
constexpr auto link_moment(const Link& link, const U& u, const A& a) {
  return vec3(link_moment_x(link, u, a), link_moment_y(link, u, a), link_moment_z(link, u, a));
}

/// axis · n, without the components of n that a known axis does not ask for.
template <typename Axis, typename Link, typename U, typename A>
constexpr auto moment_about(const Axis& axis, const Link& link, const U& u, const A& a) {
  using X = decltype(axis.x);
  using Y = decltype(axis.y);
  using Z = decltype(axis.z);
  if constexpr (kIsZero<X> && kIsZero<Y>) {
    return axis.z * link_moment_z(link, u, a);
  } else if constexpr (kIsZero<X> && kIsZero<Z>) {
    return axis.y * link_moment_y(link, u, a);
  } else if constexpr (kIsZero<Y> && kIsZero<Z>) {
    return axis.x * link_moment_x(link, u, a);
  } else {
    return dot(axis, link_moment(link, u, a));
  }
}

/// Force and moment about an origin.
template <typename F, typename M>
struct Wrench {
  [[no_unique_address]] F force;
  [[no_unique_address]] M moment;
};

template <typename F, typename M>
constexpr Wrench<F, M> make_wrench(const F& f, const M& m) {
  return {f, m};
}

/// The child's wrench in parent axes about the parent origin: f_p = Eᵀ f, n_p = Eᵀ n + p × f_p.
template <typename Rotation, typename P, typename W>
constexpr auto wrench_on_parent(const Rotation& rotation, const P& p, const W& child) {
  const auto force = transpose_times(rotation, child.force);
  return make_wrench(force, transpose_times(rotation, child.moment) + cross(p, force));
}
template <typename Frame, typename W>
constexpr auto wrench_on_parent(const Frame& frame, const W& child) {
  return wrench_on_parent(frame.rotation, frame.position, child);
}

}  // namespace heft::structural
