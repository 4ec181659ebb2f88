/// @file
/// Pseudo-inertia form of the link parameters, and their reduction to the ones that move a torque.
/// Derivation: src/core/dynamics/pseudo_inertia.md
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "heft/core/arm_model.hpp"
#include "heft/core/structural.hpp"

namespace heft {

/// A link as a 4 × 4 pseudo-inertia, by its ten different entries in the order
/// [m, hx, hy, hz, S11, S12, S22, S13, S23, S33]: mass m [kg], first moment h = m c [kg·m] and second moment
/// Σ = ∫ r rᵀ dm [kg·m²], all about the link-frame origin in link axes. Same numbers of freedom as
/// InertialParameters, linear in them: Σ = ½ tr(I) E − I, I = tr(Σ) E − Σ.
template <typename Scalar>
using PseudoInertia = std::array<Scalar, 10>;

/// Positions in PseudoInertia.
enum PseudoIndex : int { kPm = 0, kPhx, kPhy, kPhz, kS11, kS12, kS22, kS13, kS23, kS33 };

/// Inertial parameters to pseudo-inertia.
template <typename Scalar>
constexpr PseudoInertia<Scalar> to_pseudo_inertia(const InertialParameters<Scalar>& p) noexcept {
  const Scalar half_trace = (p[kIxx] + p[kIyy] + p[kIzz]) * Scalar(0.5);
  return {p[kMass],
          p[kMcx],
          p[kMcy],
          p[kMcz],
          half_trace - p[kIxx],
          -p[kIxy],
          half_trace - p[kIyy],
          -p[kIxz],
          -p[kIyz],
          half_trace - p[kIzz]};
}

/// Pseudo-inertia to inertial parameters.
template <typename Scalar>
constexpr InertialParameters<Scalar> to_inertial_parameters(const PseudoInertia<Scalar>& s) noexcept {
  return {s[kPm],   s[kPhx],           s[kPhy],  s[kPhz],  s[kS22] + s[kS33],
          -s[kS12], s[kS11] + s[kS33], -s[kS13], -s[kS23], s[kS11] + s[kS22]};
}

namespace structural {

/// A link's pseudo-inertia with typed entries.
template <typename M, typename H, typename S11, typename S12, typename S22, typename S13, typename S23,
          typename S33>
struct LinkParameters {
  [[no_unique_address]] M m;
  [[no_unique_address]] H h;
  [[no_unique_address]] S11 s11;
  [[no_unique_address]] S12 s12;
  [[no_unique_address]] S22 s22;
  [[no_unique_address]] S13 s13;
  [[no_unique_address]] S23 s23;
  [[no_unique_address]] S33 s33;
};

template <typename M, typename H, typename S11, typename S12, typename S22, typename S13, typename S23,
          typename S33>
constexpr LinkParameters<M, H, S11, S12, S22, S13, S23, S33> link_parameters(const M& m, const H& h,
                                                                             const S11& s11, const S12& s12,
                                                                             const S22& s22, const S13& s13,
                                                                             const S23& s23, const S33& s33) {
  return {m, h, s11, s12, s22, s13, s23, s33};
}

/// All ten entries of a body.
template <typename Scalar>
constexpr auto dense_link(const PseudoInertia<Scalar>& p) {
  return link_parameters(p[kPm], vec3(p[kPhx], p[kPhy], p[kPhz]), p[kS11], p[kS12], p[kS22], p[kS13], p[kS23],
                         p[kS33]);
}

/// All ten entries of a body where they are: a view.
template <typename Scalar>
constexpr auto link_view(const PseudoInertia<Scalar>& p) {
  using Ref = const Scalar&;
  using First = Vec3<Ref, Ref, Ref>;
  return LinkParameters<Ref, First, Ref, Ref, Ref, Ref, Ref, Ref>{
      p[kPm],  First{p[kPhx], p[kPhy], p[kPhz]}, p[kS11], p[kS12], p[kS22], p[kS13], p[kS23], p[kS33]};
}

/// A body that others are added to: mass, first moment h and second moment Σ about the origin of its frame, in its axes.
/// @tparam Mass  Scalar, or the known zero
template <typename Scalar, typename Mass = Scalar>
struct CompositeBody {
  [[no_unique_address]] Mass m;
  Dense3<Scalar> h;
  Scalar s11, s12, s22, s13, s23, s33;
};

/// Adds a body to the one before it. E turns the parent's axes into the child's, p is the child's origin in the parent's
/// frame. With h' = Eᵀ h and u = h' + m p / 2: m, h' + m p, Eᵀ Σ E + u pᵀ + p uᵀ.
template <typename E, typename P, typename Child, typename Parent>
constexpr void add_outboard(const E& rotation, const P& p, const Child& child, Parent& parent) {
  using Scalar = decltype(parent.s11);
  const auto& [r0, r1, r2] = rotation;
  const auto half = scale(p, child.m * Scalar(0.5));
  const auto u = transpose_times(rotation, child.h) + half;
  // Rows of Σ E.
  const auto b0 = scale(r0, child.s11) + scale(r1, child.s12) + scale(r2, child.s13);
  const auto b1 = scale(r0, child.s12) + scale(r1, child.s22) + scale(r2, child.s23);
  const auto b2 = scale(r0, child.s13) + scale(r1, child.s23) + scale(r2, child.s33);
  const auto xx = u.x * p.x;
  const auto yy = u.y * p.y;
  const auto zz = u.z * p.z;
  parent.m = parent.m + child.m;
  parent.h = parent.h + u + half;
  parent.s11 = parent.s11 + (r0.x * b0.x + r1.x * b1.x + r2.x * b2.x) + (xx + xx);
  parent.s12 = parent.s12 + (r0.x * b0.y + r1.x * b1.y + r2.x * b2.y) + (u.x * p.y + u.y * p.x);
  parent.s22 = parent.s22 + (r0.y * b0.y + r1.y * b1.y + r2.y * b2.y) + (yy + yy);
  parent.s13 = parent.s13 + (r0.x * b0.z + r1.x * b1.z + r2.x * b2.z) + (u.x * p.z + u.z * p.x);
  parent.s23 = parent.s23 + (r0.y * b0.z + r1.y * b1.z + r2.y * b2.z) + (u.y * p.z + u.z * p.y);
  parent.s33 = parent.s33 + (r0.z * b0.z + r1.z * b1.z + r2.z * b2.z) + (zz + zz);
}

}  // namespace structural

/// The same body seen from another frame: axes turned by R (row-major, turns components in the old frame
/// into components in the new one), origin of the old frame at p in the new one.
template <typename Scalar>
constexpr PseudoInertia<Scalar> moved(const PseudoInertia<Scalar>& s, const std::array<Scalar, 9>& R,
                                      const std::array<Scalar, 3>& p) noexcept {
  using namespace structural;
  const auto turned = mat3(vec3(R[0], R[3], R[6]), vec3(R[1], R[4], R[7]), vec3(R[2], R[5], R[8]));
  CompositeBody<Scalar> b{};
  add_outboard(turned, vec3(p[0], p[1], p[2]), dense_link(s), b);
  return {b.m, b.h.x, b.h.y, b.h.z, b.s11, b.s12, b.s22, b.s13, b.s23, b.s33};
}

/// True when the first joint is revolute and gravity lies along its axis: then only the inertia about that
/// axis, of all parameters of link 1, moves a torque.
template <typename Scalar, int N>
constexpr bool first_axis_is_vertical(const ArmModel<Scalar, N>& arm) noexcept {
  const auto& joint = arm.joints[0];
  if (joint.type != JointType::kRevolute) {
    return false;
  }
  // Axis in the base frame, crossed with gravity.
  Scalar a[3]{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      a[i] = a[i] + joint.rotation[3 * i + j] * joint.axis[j];
    }
  }
  const auto& g = arm.gravity;
  const Scalar tolerance = Scalar(1e-9);
  for (std::size_t i = 0; i < 3; ++i) {
    const Scalar c = a[(i + 1) % 3] * g[(i + 2) % 3] - a[(i + 2) % 3] * g[(i + 1) % 3];
    if (c > tolerance || c < -tolerance) {
      return false;
    }
  }
  return true;
}

/// Moves every parameter inboard that can be moved without changing any joint torque, so that as many as
/// possible become zero.
///
/// A body on the axis of a revolute joint and thin as a rod (mass m, first moment and second moment along
/// the axis a) acts alike whether it turns with the joint or not: it is taken off the outboard link and
/// added to the inboard one. What is left has m = 0, aᵀh = 0, aᵀΣa = 0. Across a prismatic joint links do
/// not turn against each other, so the whole of Σ passes inboard. See Gautier and Khalil (1990) for the
/// regrouping in terms of I; in terms of Σ it is one rule for any axis.
///
/// @param links  pseudo-inertias in link frames, replaced by the reduced ones
/// Cost: about 90 multiplications a joint; run it when a parameter changes, not every sample.
template <typename Scalar, int N>
constexpr void reduce(const ArmModel<Scalar, N>& arm,
                      std::array<PseudoInertia<Scalar>, std::size_t{N}>& links) noexcept {
  for (std::size_t j = static_cast<std::size_t>(N); j-- > 0;) {
    const auto& joint = arm.joints[j];
    const auto& a = joint.axis;
    PseudoInertia<Scalar>& link = links[j];
    PseudoInertia<Scalar> part{};
    if (joint.type == JointType::kRevolute) {
      const Scalar mu = a[0] * link[kPhx] + a[1] * link[kPhy] + a[2] * link[kPhz];
      const Scalar s = a[0] * (a[0] * link[kS11] + Scalar(2) * a[1] * link[kS12]) +
                       a[1] * (a[1] * link[kS22] + Scalar(2) * a[2] * link[kS23]) +
                       a[2] * (a[2] * link[kS33] + Scalar(2) * a[0] * link[kS13]);
      part = {link[kPm],       mu * a[0],       mu * a[1],       mu * a[2],       s * a[0] * a[0],
              s * a[0] * a[1], s * a[1] * a[1], s * a[0] * a[2], s * a[1] * a[2], s * a[2] * a[2]};
    } else {
      part = {Scalar(0),  Scalar(0),  Scalar(0),  Scalar(0),  link[kS11],
              link[kS12], link[kS22], link[kS13], link[kS23], link[kS33]};
    }
    for (std::size_t i = 0; i < 10; ++i) {
      link[i] = link[i] - part[i];
    }
    if (j > 0) {
      const PseudoInertia<Scalar> inboard = moved(part, joint.rotation, joint.position);
      for (std::size_t i = 0; i < 10; ++i) {
        links[j - 1][i] = links[j - 1][i] + inboard[i];
      }
    }
  }
  if (first_axis_is_vertical(arm)) {
    // aᵀ I a = tr(Σ) since aᵀΣa = 0 here. It is kept as one second moment across the axis.
    const auto& a = arm.joints[0].axis;
    PseudoInertia<Scalar>& link = links[0];
    const Scalar about_axis = link[kS11] + link[kS22] + link[kS33];
    link = PseudoInertia<Scalar>{};
    const bool along_x = a[0] > Scalar(0.5) || a[0] < Scalar(-0.5);
    link[along_x ? kS22 : kS11] = about_axis;
    // For an axis that is no coordinate axis a second moment along x would leave the plane across it.
    const bool aligned = (a[0] * a[0] > Scalar(1) - Scalar(1e-9)) ||
                         (a[1] * a[1] > Scalar(1) - Scalar(1e-9)) || (a[2] * a[2] > Scalar(1) - Scalar(1e-9));
    if (!aligned) {
      // Half of tr(Σ) (E − a aᵀ) has the same moment about the axis.
      const Scalar half = about_axis * Scalar(0.5);
      link[kS11] = half * (Scalar(1) - a[0] * a[0]);
      link[kS12] = -half * a[0] * a[1];
      link[kS22] = half * (Scalar(1) - a[1] * a[1]);
      link[kS13] = -half * a[0] * a[2];
      link[kS23] = -half * a[1] * a[2];
      link[kS33] = half * (Scalar(1) - a[2] * a[2]);
    }
  }
}

/// The reduced pseudo-inertias of an arm's own links.
template <typename Scalar, int N>
constexpr std::array<PseudoInertia<Scalar>, N> reduced_links(const ArmModel<Scalar, N>& arm) noexcept {
  std::array<PseudoInertia<Scalar>, N> links{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(N); ++j) {
    links[j] = to_pseudo_inertia(arm.links[j]);
  }
  reduce(arm, links);
  return links;
}

}  // namespace heft
