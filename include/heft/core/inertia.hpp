/// @file
/// Pseudo-inertia form of the link parameters, and their reduction to the ones that move a torque.
/// Derivation: src/core/dynamics/pseudo_inertia.md
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_model.hpp"

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

/// The same body seen from another frame: axes turned by R (row-major, turns components in the old frame
/// into components in the new one), origin of the old frame at p in the new one.
/// With h' = R h, the result is m, h' + m p, R Σ Rᵀ + h' pᵀ + p h'ᵀ + m p pᵀ.
template <typename Scalar>
constexpr PseudoInertia<Scalar> moved(const PseudoInertia<Scalar>& s, const std::array<Scalar, 9>& R,
                                      const std::array<Scalar, 3>& p) noexcept {
  const Scalar S[3][3] = {
      {s[kS11], s[kS12], s[kS13]}, {s[kS12], s[kS22], s[kS23]}, {s[kS13], s[kS23], s[kS33]}};
  Scalar RS[3][3]{};
  Scalar h[3]{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      h[i] = h[i] + R[3 * i + j] * s[1 + j];
      for (std::size_t k = 0; k < 3; ++k) {
        RS[i][j] = RS[i][j] + R[3 * i + k] * S[k][j];
      }
    }
  }
  Scalar T[3][3]{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      T[i][j] = h[i] * p[j] + p[i] * h[j] + s[kPm] * p[i] * p[j];
      for (std::size_t k = 0; k < 3; ++k) {
        T[i][j] = T[i][j] + RS[i][k] * R[3 * j + k];
      }
    }
  }
  return {s[kPm],
          h[0] + s[kPm] * p[0],
          h[1] + s[kPm] * p[1],
          h[2] + s[kPm] * p[2],
          T[0][0],
          T[0][1],
          T[1][1],
          T[0][2],
          T[1][2],
          T[2][2]};
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
